/* Data sets made from meshes. Part of vsplat.h, which includes it and whose conventions hold: handles, statuses,
   structs with their size. */
#ifndef VSPLAT_DATASET_H
#define VSPLAT_DATASET_H

#include <vsplat/vsplat.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A textured triangle mesh. Belongs to no device; may be read by several threads. */
typedef struct vsplat_mesh_impl* vsplat_mesh;

/* An OBJ, PLY, GLB or glTF file, or whatever else assimp reads, with its textures; normals are computed where there are
   none. `texture`: a picture (PNG, JPEG, EXR) that covers every part instead of the file's own textures and colours;
   NULL: the file's own. VSPLAT_ERROR_FILE where a file cannot be opened, VSPLAT_ERROR_FORMAT where it cannot be read,
   VSPLAT_ERROR_INPUT where there are no faces, a coordinate is not finite, a material file or texture that it names is
   missing, or a part to be textured has no texture coordinates. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_load(const char* path, const char* texture,
                                                           vsplat_mesh* out_mesh);

/* Random solids pushed into one another, with procedural textures: the same for the same seed and index. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_procedural(uint64_t seed, uint32_t index, vsplat_mesh* out_mesh);

VSPLAT_API void vsplat_mesh_retain(vsplat_mesh mesh);
VSPLAT_API void vsplat_mesh_release(vsplat_mesh mesh);

typedef struct vsplat_mesh_info {
  size_t size;
  uint64_t triangles;
  uint64_t textures; /* pictures, each counted once */
} vsplat_mesh_info;
#define VSPLAT_MESH_INFO_INIT \
  { sizeof(vsplat_mesh_info), 0, 0 }

VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_get_info(vsplat_mesh mesh, vsplat_mesh_info* out_info);

typedef struct vsplat_mesh_views_options {
  size_t size;
  int32_t views;                     /* pictures, 1 to 9999 */
  int32_t pixels;                    /* their sides, 8 to 8192 */
  uint64_t seed;                     /* of the cameras' jitter */
  uint32_t index;                    /* of the object in its set: each has other cameras */
  vsplat_progress_function progress; /* may be NULL; stage "pictures" */
  void* user;
} vsplat_mesh_views_options;
#define VSPLAT_MESH_VIEWS_OPTIONS_INIT \
  { sizeof(vsplat_mesh_views_options), 40, 512, 0, 0, NULL, NULL }

/* Writes the mesh as an object of a data set: images/0000.png, ... (8-bit RGBA, straight alpha) and transforms.json in
   `folder`, which is made where there is none; existing files are replaced. The mesh is moved and scaled so that its
   bounding box is centred at the origin and its longest edge is 1: aabb_center 0,0,0, aabb_half 0.5. The cameras are
   spread over the whole sphere, look at the origin with y up and a field of view of 49.1 degrees, and see all of the
   mesh from distances of 1.6 to 1.9, farther only where it would not fit. Light is soft, fixed to the object, without
   shadows. transforms.json is written last; a failure takes away what was written. The same bytes on one machine for
   the same arguments. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_write_views(vsplat_mesh mesh,
                                                                  const vsplat_mesh_views_options* options,
                                                                  const char* folder);

/* What objects are called whose files these are, as a JSON list of texts: a file's stem, or its folder's name where
   stems repeat or are "model"; of those that are equal then, the second is NAME_2, the third NAME_3. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_object_names(const char* const* paths, size_t num_paths,
                                                              char** out_text);

#ifdef __cplusplus
}
#endif

#endif
