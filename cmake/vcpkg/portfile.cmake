# vsplat for vcpkg, on Linux, as an overlay port of this checkout: `vcpkg install vsplat --overlay-ports=cmake/vcpkg`. Written by vcpkg's
# documentation and its ports; nobody has run it yet (cmake/README.md).
get_filename_component(SOURCE_PATH "${CURRENT_PORT_DIR}/../.." ABSOLUTE)

vcpkg_check_features(OUT_FEATURE_OPTIONS features FEATURES
  data VSPLAT_DATA
  mpi VSPLAT_MPI
)
# The source includes it as Debian has it: <stb/stb_image.h>.
file(COPY "${CURRENT_INSTALLED_DIR}/include/stb_image.h" DESTINATION "${CURRENT_BUILDTREES_DIR}/stb/stb")
vcpkg_find_acquire_program(PKGCONFIG)
vcpkg_cmake_configure(
  SOURCE_PATH "${SOURCE_PATH}"
  OPTIONS
    ${features}
    -DVSPLAT_TESTS=OFF
    "-DSTB_INCLUDE_DIR=${CURRENT_BUILDTREES_DIR}/stb"
    "-DPKG_CONFIG_EXECUTABLE=${PKGCONFIG}"
)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/vsplat)
vcpkg_fixup_pkgconfig()
vcpkg_copy_tools(TOOL_NAMES vsplat AUTO_CLEAN)
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share" "${CURRENT_PACKAGES_DIR}/debug/libexec")
file(INSTALL "${CURRENT_PORT_DIR}/usage" DESTINATION "${CURRENT_PACKAGES_DIR}/share/${PORT}")
vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE")
