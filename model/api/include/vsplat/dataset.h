/* Data sets, made from meshes and read. Part of vsplat.h, which includes it and whose conventions hold: handles,
   statuses, structs with their size. */
#ifndef VSPLAT_DATASET_H
#define VSPLAT_DATASET_H

#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A textured triangle mesh. Belongs to no device; may be read by several threads. */
typedef struct vsplat_mesh_impl* vsplat_mesh;

/* An OBJ, PLY, STL, GLB or glTF file with its textures; normals are computed where there are none. Where a texture's
   alpha is below one half (glTF: below the material's cut-off) there is no surface, and nothing is half-transparent.
   `texture`: a picture (PNG, JPEG, EXR) that covers every part instead of the file's own textures and colours; NULL:
   the file's own. Read in a process of its own, by the program libexec/vsplat/vsplat-read. VSPLAT_ERROR_FILE where a
   file cannot be opened, VSPLAT_ERROR_FORMAT where it cannot be read, or takes more time or memory than a file of its
   size should, VSPLAT_ERROR_INPUT where the file is of another kind, there are no faces, a coordinate is not finite, a
   material file or texture that it names is missing, or a part to be textured has no texture coordinates. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_load(const char* path, const char* texture,
                                                           vsplat_mesh* out_mesh);

/* Random solids pushed into one another, with procedural textures: the same for the same seed and index. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_procedural(uint64_t seed, uint32_t index, vsplat_mesh* out_mesh);

typedef struct vsplat_mesh_procedural_options {
  size_t size;
  uint64_t seed;
  uint32_t index;       /* of the object: each is another one */
  const char* textures; /* NULL, or a folder of pictures (PNG, JPEG, EXR, TIFF, WebP, BMP), which half of the parts are
                           covered with */
} vsplat_mesh_procedural_options;
#define VSPLAT_MESH_PROCEDURAL_OPTIONS_INIT \
  { sizeof(vsplat_mesh_procedural_options), 0, 0, NULL }

/* An object of one to nine parts: bodies, some with others cut out of them or with a height field, wire frames, thin
   rods, plates, hoops and springs; some twisted, bent or tapered; of one colour, a gradient, a pattern or a texture.
   The same for the same options. VSPLAT_ERROR_FILE where the folder cannot be read, VSPLAT_ERROR_INPUT where no picture
   is in it, VSPLAT_ERROR_FORMAT where one cannot be read. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_procedural_with(const vsplat_mesh_procedural_options* options,
                                                                      vsplat_mesh* out_mesh);

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
   `folder`, which appears whole or not at all: an earlier object there is replaced in one step, what else lies in the
   folder stays. VSPLAT_ERROR_FILE where another process is writing it. The mesh is moved and scaled so that its
   bounding box is centred at the origin and its longest edge is 1: aabb_center 0,0,0, aabb_half 0.5. The cameras are
   spread over the whole sphere, look at the origin with y up and a field of view of 49.1 degrees, and see all of the
   mesh from distances of 1.6 to 1.9, farther only where it would not fit. Light is soft, fixed to the object, without
   shadows. The same bytes on one machine for the same arguments. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_write_views(vsplat_mesh mesh,
                                                                  const vsplat_mesh_views_options* options,
                                                                  const char* folder);

/* What objects are called whose files these are, as a JSON list of texts: a file's stem, or its folder's name where
   stems repeat or are "model"; of those that are equal then, the second is NAME_2, the third NAME_3. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_object_names(const char* const* paths, size_t num_paths,
                                                              char** out_text);

/* -------------------------------------------------------------------------------------------------------- reading */

/* Objects with posed pictures, of one or more of these: a folder for each object that vsplat_views_load takes (masks,
   alpha, aabb_center and aabb_half as there), or LaRa's layout of Google Scanned Objects (transforms.json with
   intrinsic_matrix, r_000.png, ...), in folders at most four levels down; HDF5 files in LaRa's layout (a group for each
   object with image_I [H][W][4] of 8 bits, c2w_I [4][4], OpenCV axes, and fov_I [2] in radians). Belongs to no device;
   may be read by several threads. */
typedef struct vsplat_dataset_impl* vsplat_dataset;

/* Lists the objects of the folders or HDF5 files, in the order of the paths, in each by name; no picture is read.
   VSPLAT_ERROR_FILE where a path is not there, VSPLAT_ERROR_INPUT where it holds no object, VSPLAT_ERROR_FORMAT for a
   damaged HDF5 file. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_open(const char* const* paths, size_t num_paths,
                                                              vsplat_dataset* out_dataset);
VSPLAT_API void vsplat_dataset_retain(vsplat_dataset dataset);
VSPLAT_API void vsplat_dataset_release(vsplat_dataset dataset);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_count(vsplat_dataset dataset, size_t* out_count);

/* An object by its index as a JSON object of texts: "name" (its folder's or group's; of those that are equal, the
   second is NAME_2), "layout" (folder, gso or hdf5) and "path" (the folder, or the HDF5 file). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_describe(vsplat_dataset dataset, size_t index,
                                                                  char** out_text);

typedef struct vsplat_dataset_object {
  size_t size;
  int32_t views;                /* that can be used: a picture (and its mask) is there, the camera is sound */
  int32_t bad;                  /* other views, and pictures that were looked at and cannot be used */
  int32_t min_width, max_width; /* pixels */
  int32_t min_height, max_height;
  double min_fov, max_fov;           /* degrees, across the picture */
  double min_distance, max_distance; /* of the cameras from the middle of the object's cube, in its edges */
  double center[3];                  /* the cube, in the object's own world */
  double scale;
  int32_t pictures; /* that were decoded */
  double coverage;  /* mean alpha (or mask) of these, over the square that the network sees; 0 to 1 */
} vsplat_dataset_object;
#define VSPLAT_DATASET_OBJECT_INIT \
  { sizeof(vsplat_dataset_object), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, {0, 0, 0}, 0, 0, 0 }

/* Reads an object's cameras, and decodes `pictures` of its pictures, spread over the views (-1: all). `out_bad`: a JSON
   list of what is wrong with single views; may be NULL. VSPLAT_ERROR_FILE, _FORMAT or _INPUT, naming object, view and
   field, where the object as a whole cannot be used. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_survey(vsplat_dataset dataset, size_t index, int32_t pictures,
                                                                vsplat_dataset_object* out_object, char** out_bad);

/* A view (below vsplat_dataset_object.views) of an object as the network would get it at this size: [side][side][3] on
   white, which `capacity` floats have room for. Errors name object, view and what is wrong. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_get_picture(vsplat_dataset dataset, size_t index, int32_t view,
                                                                     int32_t side, float* out_pixels, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif
