# Drivers of GDAL that the static build has beside those that Cargo.toml of the workspace names as features of `gdal-src`:
# NITF, whose feature is misspelt there and does nothing, and JPEG 2000 through OpenJPEG. The Makefile gives this file to CMake
# as CMAKE_TOOLCHAIN_FILE, which the build script passes on.
set(GDAL_ENABLE_DRIVER_NITF ON CACHE BOOL "" FORCE)
set(GDAL_USE_OPENJPEG ON CACHE BOOL "" FORCE)
set(GDAL_ENABLE_DRIVER_JP2OPENJPEG ON CACHE BOOL "" FORCE)

# `gdal-src` leaves out the data files of the NITF driver, which GDAL would copy and install. They describe extensions that
# are neither image nor RPC. This drops missing files from the list before GDAL's own installation rules use it. CMake keeps
# a command that was replaced once under its name with an underscore, and reads this file several times.
if(NOT COMMAND _install)
  function(install)
    if(TARGET GDAL)
      get_property(listed TARGET GDAL PROPERTY RESOURCE)
      set(present "")
      foreach(file IN LISTS listed)
        get_filename_component(path "${file}" ABSOLUTE BASE_DIR "${CMAKE_SOURCE_DIR}")
        if(EXISTS "${path}")
          list(APPEND present "${file}")
        endif()
      endforeach()
      set_property(TARGET GDAL PROPERTY RESOURCE "${present}")
    endif()
    # Arguments may hold semicolons, so each is quoted by itself.
    set(arguments "")
    math(EXPR last "${ARGC} - 1")
    foreach(number RANGE ${last})
      string(APPEND arguments " [==[${ARGV${number}}]==]")
    endforeach()
    cmake_language(EVAL CODE "_install(${arguments})")
  endfunction()
endif()
