# cpack -G DEB in the build folder: the program with its manual, and the libraries with their headers.
set(CPACK_PACKAGE_NAME effuse)
set(CPACK_PACKAGE_CONTACT "effuse")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "lava over real terrain: particles, surfaces, meshes")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES OFF)  # CPack would strip the static libraries of their symbols, too
set(CPACK_GENERATOR DEB)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
# Loaded when it is needed, so not among what the program is linked to.
string(REGEX MATCH "[0-9]+$" gdal_version "${EFFUSE_GDAL_LIBRARY}")
set(CPACK_DEBIAN_PACKAGE_DEPENDS "libgdal${gdal_version}")
set(CPACK_DEBIAN_PACKAGE_SUGGESTS "ffmpeg, blender, paraview")
# To link our rooms.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS "libcgal-dev, libeigen3-dev, libassimp-dev, libopenvdb-dev, libboost-iostreams-dev, libtbb-dev, libfcl-dev, libembree-dev, libtomlplusplus-dev, libfmt-dev, libpng-dev, libopenexr-dev, zlib1g-dev")
include(CPack)
