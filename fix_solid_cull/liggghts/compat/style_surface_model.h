// Debian's libliggghts-dev leaves out LIGGGHTS's generated list of surface models, which its wall header includes. solidcull asks
// the engine for forces and never names a model, so an empty list serves; a LIGGGHTS of your own that has the list goes first.
