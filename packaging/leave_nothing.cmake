# CPack gives a package with a library scripts that call ldconfig. dpkg remembers a package that has such scripts after it is removed.
# The trigger is what Debian's own packages have in their place.
foreach(package ${CPACK_PACKAGE_FILES})
  set(open ${package}.open)
  file(REMOVE_RECURSE ${open})
  execute_process(COMMAND dpkg-deb -R ${package} ${open} COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE ${open}/DEBIAN/postinst ${open}/DEBIAN/postrm)
  file(WRITE ${open}/DEBIAN/triggers "activate-noawait ldconfig\n")
  execute_process(COMMAND dpkg-deb --root-owner-group -b ${open} ${package} OUTPUT_QUIET COMMAND_ERROR_IS_FATAL ANY)
  file(REMOVE_RECURSE ${open})
endforeach()
