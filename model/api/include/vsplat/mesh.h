/* The surface of a scene as a triangle mesh. Part of vsplat.h, which states the common conventions. The handle
   vsplat_mesh is declared in dataset.h. */
#ifndef VSPLAT_MESH_H
#define VSPLAT_MESH_H

#include <vsplat/dataset.h>
#include <vsplat/device.h>
#include <vsplat/scene.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Which depth of a pixel is its surface's; see vsplat_picture. */
typedef enum vsplat_surface_depth {
  VSPLAT_SURFACE_MEDIAN = 0,
  VSPLAT_SURFACE_EXPECTED = 1 /* faster for volumes; between two surfaces at the edge of the nearer one */
} vsplat_surface_depth;

typedef struct vsplat_scene_mesh_options {
  size_t size;
  const vsplat_camera* cameras; /* [num_cameras], in the world; NULL: 48 about the scene, on circles at 0, 35 and 70
                                   degrees above and below its middle, and at both poles */
  size_t num_cameras;
  int32_t voxels;         /* along the longest edge of the box in which the surface is looked for: 16 to 2048. Pictures
                             are drawn with at most two pixels a voxel along their longer side, and at most 2048 */
  uint64_t max_triangles; /* 0: no limit */
  double least_part;      /* connected parts with a smaller share of the largest part's area are left out, 0 to 1 */
  int32_t has_center;     /* 1: `center` is set; then `scale` is needed, too */
  double center[3];       /* of the cube, in the world. Without it, the box is what the pictures show of the surface.
                             With `cameras`, this box ends at 1.1 times the largest distance of a camera from their
                             mean, or at 1.3 times the median distance of the surface from there, whichever is larger */
  double scale;           /* the cube's edge, world units; 0: without a cube */
  vsplat_surface_depth depth;
  vsplat_progress_function progress; /* stages "surface", "fusion" and "triangles"; called before each picture */
  void* user;
} vsplat_scene_mesh_options;
#define VSPLAT_SCENE_MESH_OPTIONS_INIT \
  { sizeof(vsplat_scene_mesh_options), NULL, 0, 256, 0, 0.01, 0, {0, 0, 0}, 0.0, VSPLAT_SURFACE_MEDIAN, NULL, NULL }

/* Draws depths and colours of the scene from the cameras, fuses them in a signed distance field (truncated at 4 voxels
   or 1/80 of the box, whichever is larger), and returns the surface where it is 0, with a normal and a colour at each
   vertex. A pixel shows a surface where alpha is 0.5 or more. Colours are as seen from the cameras, on average. The
   surface is closed except where no camera has seen it and at the end of the box. Equal calls on one device give equal
   meshes. The mesh belongs to no device. `options` NULL: defaults. VSPLAT_ERROR_INPUT: the pictures show no surface, or
   none in the cube. VSPLAT_ERROR_MEMORY: the volume needs more host memory than there is, 28 bytes for each voxel near
   the surface. VSPLAT_ERROR_CANCELLED: `progress` returned 0, or vsplat_device_cancel. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_from_scene(vsplat_device device, vsplat_scene scene,
                                                                 const vsplat_scene_mesh_options* options,
                                                                 vsplat_mesh* out_mesh);

/* Writes a mesh that was made from a scene, whole or not at all; replaces an existing file. The name's ending selects
   the format. .ply: binary, positions in the world (as doubles if the scene has an offset), normals, 8-bit sRGB
   colours. .glb: glTF 2.0 with x, y and z as -x, -y and z, so that a world with y down stands upright, as scenes in
   .glb files do; normals, linear 16-bit colours, unlit. VSPLAT_ERROR_USAGE: another ending, or a mesh of vsplat_mesh_load or
   vsplat_mesh_procedural. VSPLAT_ERROR_FILE: the file cannot be written. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_save(vsplat_mesh mesh, const char* path);

/* The caller's arrays; NULL for what is not wanted. */
typedef struct vsplat_mesh_arrays {
  size_t size;
  uint64_t vertex_capacity, triangle_capacity; /* how many fit into the arrays: those of vsplat_mesh_info are needed */
  double* positions;                           /* [vertices][3], in the world */
  float* normals;                              /* [vertices][3], of length 1, outwards */
  float* colours;                              /* [vertices][3], sRGB-encoded, 0 to 1 */
  uint32_t* triangles;                         /* [triangles][3], counter-clockwise seen from outside */
} vsplat_mesh_arrays;
#define VSPLAT_MESH_ARRAYS_INIT \
  { sizeof(vsplat_mesh_arrays), 0, 0, NULL, NULL, NULL, NULL }

/* Copies a mesh that was made from a scene to the caller's arrays. VSPLAT_ERROR_USAGE: arrays that are too small or
   share memory, or a mesh of vsplat_mesh_load or vsplat_mesh_procedural. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_get_arrays(vsplat_mesh mesh, const vsplat_mesh_arrays* arrays);

#ifdef __cplusplus
}
#endif

#endif
