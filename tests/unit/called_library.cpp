// A library that calls a function of its own, which a program may put its own in place of. Linked with and without
// -Bsymbolic-functions, see test_relocations.cpp; ANSWER and CALLER keep the two apart.
extern "C" int ANSWER() { return 1; }
extern "C" int CALLER() { return ANSWER(); }
extern "C" int (*const TABLE)() = ANSWER;
