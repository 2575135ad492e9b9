# Drivers of GDAL that the static build has beside those that the features of `gdal-src` name (Cargo.toml of the workspace):
# NITF, whose feature is misspelt there and does nothing, and JPEG 2000 through OpenJPEG. The Makefile gives this file to CMake
# as CMAKE_TOOLCHAIN_FILE, which the build script passes on.
set(GDAL_ENABLE_DRIVER_NITF ON CACHE BOOL "" FORCE)
set(GDAL_USE_OPENJPEG ON CACHE BOOL "" FORCE)
set(GDAL_ENABLE_DRIVER_JP2OPENJPEG ON CACHE BOOL "" FORCE)
