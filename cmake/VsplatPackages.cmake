# Debian packages, by CPack: `cmake --build build/release --target package` puts them into build/release/packages.
#   libvsplat1      the library, with the model inside
#   libvsplat1-data the programs that read meshes and HDF5 files, and draw meshes and random objects: Embree, assimp, Draco, meshoptimizer, HDF5
#   libvsplat-dev   headers, CMake package, pkg-config file; example programs as documentation
#   libvsplat1-mpi  the MPI module, if VSPLAT_MPI builds it
#   vsplat-window   the example that shows a scene and rotates it with the mouse, if SDL is installed
#   vsplat          the command with its manual and completions, the Python module, and four example pictures
# tests/install/packages.sh installs them in a bare system.
set(VSPLAT_MAINTAINER "" CACHE STRING "Maintainer of the packages, NAME <ADDRESS>; empty: the author of the newest commit")
set(maintainer ${VSPLAT_MAINTAINER})
if(NOT maintainer)
  execute_process(COMMAND git log -1 "--format=%an <%ae>" WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    OUTPUT_VARIABLE maintainer OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
if(NOT maintainer)
  message(STATUS "No packages: VSPLAT_MAINTAINER is empty, and there is no commit that has an author")
  return()
endif()

# The licence: one copy for an installation of everything, and one for each package.
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT licence)
set(library_package libvsplat${VSPLAT_SOVERSION})
set(parts library:${library_package} dev:libvsplat-dev tools:vsplat)
if(VSPLAT_DATA)
  list(APPEND parts data:${library_package}-data)
endif()
if(TARGET window_example)
  list(APPEND parts window:vsplat-window)
endif()
if(TARGET vsplat_mpi)
  list(APPEND parts mpi:${library_package}-mpi)
endif()
set(CPACK_COMPONENTS_ALL)
foreach(part ${parts})
  string(REPLACE ":" ";" part ${part})
  list(GET part 0 component)
  list(GET part 1 name)
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/${name} RENAME copyright
    COMPONENT ${component} EXCLUDE_FROM_ALL)
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name})
  list(APPEND CPACK_COMPONENTS_ALL ${component})
endforeach()
get_cmake_property(components COMPONENTS)
if(Unspecified IN_LIST components)
  message(FATAL_ERROR "What is installed without COMPONENT is in no package: each install() of a CMakeLists.txt has to name one (${components})")
endif()

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/packages)
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_GROUPING IGNORE)  # one package for each component
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_PACKAGE_CONTACT ${maintainer})
set(CPACK_DEBIAN_PACKAGE_MAINTAINER ${maintainer})
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/model/api)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")  # within a major version the interface only grows
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # the first line of each package's description

set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_RECOMMENDS "pocl-opencl-icd | opencl-icd")  # works with any driver, and not at all without one
set(CPACK_DEBIAN_LIBRARY_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: library
Turns four posed photographs of an object into a 3D Gaussian splat and draws it
from anywhere, in one forward pass of a network, on any OpenCL 1.2 device: a GPU,
or the processor alone. Also trains and measures such models.
.
This package has the library, with a small trained model inside.")
set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "${library_package} (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DEV_PACKAGE_SUGGESTS "opencl-c-headers, pkg-config | cmake")
set(CPACK_DEBIAN_DEV_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: development files
What is needed to build C and C++ programs on libvsplat: headers, a CMake package,
a pkg-config file, and examples. vsplat/opencl.h needs OpenCL's headers.")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_TOOLS_PACKAGE_DEPENDS "${library_package} (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS "${library_package}-data")
set(CPACK_DEBIAN_TOOLS_PACKAGE_SUGGESTS "python3-numpy")
set(CPACK_DEBIAN_TOOLS_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: command
The command vsplat: makes scenes from posed photographs, fits and draws them,
makes data sets, trains and measures models, and measures itself. Includes a
Python module in /usr/share/vsplat/python.")
set(CPACK_DEBIAN_WINDOW_PACKAGE_SECTION graphics)
set(CPACK_DEBIAN_WINDOW_PACKAGE_DEPENDS "${library_package} (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_WINDOW_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: viewer
The program vsplat-window: a scene in a window, turned with the mouse.")
set(CPACK_DEBIAN_DATA_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_DATA_PACKAGE_DEPENDS "${library_package} (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_DATA_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: data sets
With this package, libvsplat and the command vsplat draw meshes and random objects
as posed pictures, for training and measuring, and read HDF5 files. It is not
needed to reconstruct and draw scenes, or to train on pictures.")
set(CPACK_DEBIAN_MPI_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS "${library_package} (= ${PROJECT_VERSION})")
set(CPACK_DEBIAN_MPI_DESCRIPTION "3D Gaussian splats from posed photos on OpenCL: MPI
With this module, several processes of the command vsplat, started by mpirun,
share a training's steps, an evaluation's objects or a list of scenes.")
include(CPack)
