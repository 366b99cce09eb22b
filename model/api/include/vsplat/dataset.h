/* Data sets: rendering them from meshes, and reading them. Part of vsplat.h, which includes this file and states the
   common conventions: handles, statuses, structs that begin with their size. */
#ifndef VSPLAT_DATASET_H
#define VSPLAT_DATASET_H

#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* A triangle mesh: textured, or the surface of a scene (mesh.h). Belongs to no device; several threads may read it. */
typedef struct vsplat_mesh_impl* vsplat_mesh;

/* Loads an OBJ, PLY, STL, GLB or glTF file with its textures. Missing normals are computed. Where a texture's alpha is
   below one half (glTF: below the material's cut-off) there is no surface; nothing is half-transparent. `texture`: a
   picture (PNG, JPEG, EXR) that covers every part instead of the file's own textures and colours; NULL: the file's own.
   The program libexec/vsplat/vsplat-read reads the file in a process of its own. VSPLAT_ERROR_FILE: a file cannot be
   opened. VSPLAT_ERROR_FORMAT: the file cannot be parsed, or reading it takes more time or memory than a file of its
   size should. VSPLAT_ERROR_INPUT: the file is of another kind, has no faces, has a coordinate that is not finite,
   names a material file or texture that is missing, or has a part without texture coordinates that is to be
   textured. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_load(const char* path, const char* texture,
                                                           vsplat_mesh* out_mesh);

/* Makes an object of random interpenetrating solids with procedural textures. Equal seed and index give equal
   objects. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_procedural(uint64_t seed, uint32_t index, vsplat_mesh* out_mesh);

typedef struct vsplat_mesh_procedural_options {
  size_t size;
  uint64_t seed;
  uint32_t index;       /* the object's number: each index gives another object */
  const char* textures; /* NULL, or a folder of pictures (PNG, JPEG, EXR, TIFF, WebP, BMP); half of the parts are
                           textured with one of them */
} vsplat_mesh_procedural_options;
#define VSPLAT_MESH_PROCEDURAL_OPTIONS_INIT \
  { sizeof(vsplat_mesh_procedural_options), 0, 0, NULL }

/* Makes an object of one to nine parts: bodies (some with others cut out of them, some with a height field), wire
   frames, thin rods, plates, hoops and springs. Some parts are twisted, bent or tapered. Each has one colour, a
   gradient, a pattern or a texture. Equal options give equal objects. VSPLAT_ERROR_FILE: the folder cannot be read.
   VSPLAT_ERROR_INPUT: the folder holds no picture. VSPLAT_ERROR_FORMAT: a picture cannot be decoded. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_procedural_with(const vsplat_mesh_procedural_options* options,
                                                                      vsplat_mesh* out_mesh);

VSPLAT_API void vsplat_mesh_retain(vsplat_mesh mesh);
VSPLAT_API void vsplat_mesh_release(vsplat_mesh mesh);

typedef struct vsplat_mesh_info {
  size_t size;
  uint64_t triangles;
  uint64_t textures; /* number of texture pictures, each counted once */
  uint64_t vertices; /* of a mesh that was made from a scene (mesh.h), else 0: other meshes share no vertices */
} vsplat_mesh_info;
#define VSPLAT_MESH_INFO_INIT \
  { sizeof(vsplat_mesh_info), 0, 0, 0 }

VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_get_info(vsplat_mesh mesh, vsplat_mesh_info* out_info);

typedef struct vsplat_mesh_views_options {
  size_t size;
  int32_t views;                     /* number of pictures, 1 to 9999 */
  int32_t pixels;                    /* width and height of a picture, 8 to 8192 */
  uint64_t seed;                     /* seed of the cameras' jitter */
  uint32_t index;                    /* the object's number in its data set: each has other cameras */
  vsplat_progress_function progress; /* may be NULL; stage "pictures" */
  void* user;
} vsplat_mesh_views_options;
#define VSPLAT_MESH_VIEWS_OPTIONS_INIT \
  { sizeof(vsplat_mesh_views_options), 40, 512, 0, 0, NULL, NULL }

/* Renders the mesh as an object of a data set: writes images/0000.png, ... (8-bit RGBA, straight alpha) and
   transforms.json to `folder`. The object appears whole or not at all: an earlier object there is replaced in one step,
   and other files in the folder stay. VSPLAT_ERROR_FILE: another process is writing it. The mesh is moved and scaled so
   that its bounding box is centred at the origin and its longest edge is 1: aabb_center 0,0,0, aabb_half 0.5. The
   cameras are spread over the whole sphere and look at the origin with y up and a field of view of 49.1 degrees. They
   see all of the mesh from distances of 1.6 to 1.9, or from farther away if it would not fit otherwise. Light is soft,
   fixed to the object, and casts no shadows. On one machine, equal arguments give equal bytes. `options` NULL:
   defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_mesh_write_views(vsplat_mesh mesh,
                                                                  const vsplat_mesh_views_options* options,
                                                                  const char* folder);

/* Names for the objects in these files, as a JSON list of strings. An object is named after its file's stem, or after
   its folder if stems repeat or are "model". Equal names are numbered: the second is NAME_2, the third NAME_3. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_object_names(const char* const* paths, size_t num_paths,
                                                              char** out_text);

/* -------------------------------------------------------------------------------------------------------- reading */

/* Objects with posed pictures, from folders and HDF5 files in one or more of these layouts: a folder for each object
   that vsplat_views_load reads (with masks, alpha, aabb_center and aabb_half); LaRa's layout of Google Scanned Objects
   (transforms.json with intrinsic_matrix, r_000.png, ...); HDF5 files in LaRa's layout (a group for each object with
   image_I [H][W][4] of 8 bits, c2w_I [4][4], OpenCV axes, and fov_I [2] in radians). Object folders are searched at
   most four levels down. Belongs to no device; several threads may read it. */
typedef struct vsplat_dataset_impl* vsplat_dataset;

/* Lists the objects of the folders or HDF5 files, in the order of the paths, and by name within each path. Reads no
   picture. VSPLAT_ERROR_FILE: a path does not exist. VSPLAT_ERROR_INPUT: a path holds no object. VSPLAT_ERROR_FORMAT:
   an HDF5 file is damaged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_open(const char* const* paths, size_t num_paths,
                                                              vsplat_dataset* out_dataset);
VSPLAT_API void vsplat_dataset_retain(vsplat_dataset dataset);
VSPLAT_API void vsplat_dataset_release(vsplat_dataset dataset);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_count(vsplat_dataset dataset, size_t* out_count);

/* Describes object `index` as a JSON object of strings: "name" (of its folder or group; the second of equal names is
   NAME_2), "layout" (folder, gso or hdf5) and "path" (the folder, or the HDF5 file). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_describe(vsplat_dataset dataset, size_t index,
                                                                  char** out_text);

typedef struct vsplat_dataset_object {
  size_t size;
  int32_t views;                /* usable views: the picture (and its mask) exists, and the camera is valid */
  int32_t bad;                  /* other views, and pictures that were read and cannot be used */
  int32_t min_width, max_width; /* pixels */
  int32_t min_height, max_height;
  double min_fov, max_fov;           /* horizontal, degrees */
  double min_distance, max_distance; /* from a camera to the cube's centre, in edges of the cube */
  double center[3];                  /* of the cube, in the object's own world coordinates */
  double scale;
  int32_t pictures; /* pictures decoded */
  double coverage;  /* mean alpha (or mask) of these, over the square that the network sees; 0 to 1 */
} vsplat_dataset_object;
#define VSPLAT_DATASET_OBJECT_INIT \
  { sizeof(vsplat_dataset_object), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, {0, 0, 0}, 0, 0, 0 }

/* Reads an object's cameras and decodes `pictures` of its pictures, spread over the views (-1: all). `out_bad`: a JSON
   list of what is wrong with single views; may be NULL. VSPLAT_ERROR_FILE, _FORMAT or _INPUT, naming object, view and
   field: the object as a whole cannot be used. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_survey(vsplat_dataset dataset, size_t index, int32_t pictures,
                                                                vsplat_dataset_object* out_object, char** out_bad);

/* Copies a view of an object (`view` is below vsplat_dataset_object.views) as the network would get it at this size:
   [side][side][3] over white. `capacity`: floats that fit into `out_pixels`. Errors name object, view and what is
   wrong. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_dataset_get_picture(vsplat_dataset dataset, size_t index, int32_t view,
                                                                     int32_t side, float* out_pixels, size_t capacity);

#ifdef __cplusplus
}
#endif

#endif
