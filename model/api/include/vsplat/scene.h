/* Scenes: Gaussians and how to draw them. Part of vsplat.h, which states the common conventions. */
#ifndef VSPLAT_SCENE_H
#define VSPLAT_SCENE_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Gaussians in one frame, with the settings to draw them with. */
typedef struct vsplat_scene_impl* vsplat_scene;

typedef struct vsplat_scene_info {
  size_t size;
  uint64_t count;     /* number of Gaussians */
  int32_t sh_degree;  /* 0 to 4; drawn up to 3 */
  double near_plane;  /* world units */
  int32_t has_mirror; /* 1: view-dependent colour is evaluated from the camera's mirror image about `mirror` */
  double mirror[3];   /* relative to `offset` */
  /* Gaussians that vsplat_scene_load_with skipped because of `skip_bad`, by reason. */
  uint64_t skipped_not_finite;    /* a value is NaN or infinite; an infinite opacity logit means opacity 0 or 1 and is
                                     accepted */
  uint64_t skipped_huge_scale;    /* the exponential of a scale overflows a float */
  uint64_t skipped_zero_rotation; /* the quaternion's length is 0 */
  double up[3];                   /* up direction, of length 1; 0, 0, 0: unknown */
  /* Origin of the means in the world: vsplat_gaussians.means plus this is in the world, and so is `mirror` plus this.
     It is 0, 0, 0, except for an object so far from the world's origin that floats would not hold it to 1e-4 of its
     cube's edge. Cameras are always in the world. */
  double offset[3];
  int32_t surfels; /* 1: flat; scales[2] of each is 0, and its third axis is its normal; 0: volumes with three scales */
  /* Width in the world, at `detail_middle`, of a pixel of the pictures that the scene was made from.
     vsplat_render_options.supersample 0 chooses by it; 0: unknown, one sample a pixel. */
  double detail_pixel;
  double detail_middle[3]; /* centre of the object, relative to `offset` */
  int32_t antialias;       /* 1: made to be drawn with anti-aliasing (vsplat_render_options); never 1 for surfels */
} vsplat_scene_info;
#define VSPLAT_SCENE_INFO_INIT \
  { sizeof(vsplat_scene_info), 0, 0, 0.0, 0, {0, 0, 0}, 0, 0, 0, {0, 0, 0}, {0, 0, 0}, 0, 0.0, {0, 0, 0}, 0 }

/* The caller's arrays; NULL for one that is not wanted. K Gaussians, S = (sh_degree + 1)^2. */
typedef struct vsplat_gaussians {
  size_t size;
  uint64_t capacity; /* number of Gaussians that fit into every array */
  float* means;      /* [K][3] world, relative to vsplat_scene_info.offset */
  float* scales;     /* [K][3] standard deviations, world units; the third of a surfel is 0 */
  float* rotations;  /* [K][4] quaternions w, x, y, z; of length 1 unless the caller set others */
  float* opacities;  /* [K] in [0,1] */
  float* sh;         /* [K][S][3] colour = max(0, 0.5 + basis . sh), in the basis of 3DGS files */
} vsplat_gaussians;
#define VSPLAT_GAUSSIANS_INIT \
  { sizeof(vsplat_gaussians), 0, NULL, NULL, NULL, NULL, NULL }

/* A format of scene files. The texts belong to the library and are valid while it is loaded. */
typedef struct vsplat_scene_format {
  size_t size;
  const char* name;      /* "ply", "spz", ...: what vsplat_scene_save_options.format takes */
  const char* title;     /* "3DGS PLY" */
  const char* endings;   /* ".glb .gltf": of files in this format, in lower case, separated by spaces */
  int32_t reads;         /* 1: vsplat_scene_load reads it */
  int32_t writes;        /* 1: vsplat_scene_save writes it */
  int32_t sh_degree;     /* highest degree of spherical harmonics that is written */
  int32_t lossless;      /* 1: values are kept to a few units of the last place of a float */
  const char* lost;      /* what no file of the format holds, in English */
  const char* opened_by; /* other programs that open it, in English */
} vsplat_scene_format;
#define VSPLAT_SCENE_FORMAT_INIT \
  { sizeof(vsplat_scene_format), NULL, NULL, NULL, 0, 0, 0, 0, NULL, NULL }
/* How many formats there are; vsplat_scene_format_get gives number `index` of them. */
VSPLAT_API size_t vsplat_scene_format_count(void);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_format_get(size_t index, vsplat_scene_format* out_format);

/* Reads a scene of any format in the table, identified by its content, and by its ending where the content does not
   say. A PLY may be binary or ASCII, and have surfels as in 2DGS, with two scales each. VSPLAT_ERROR_FORMAT names the
   Gaussian, the property and the byte of the first value that cannot be drawn. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load(const char* path, vsplat_scene* out_scene);

typedef struct vsplat_scene_load_options {
  size_t size;
  int32_t skip_bad; /* 1: skips and counts single Gaussians that cannot be drawn (vsplat_scene_info) */
} vsplat_scene_load_options;
#define VSPLAT_SCENE_LOAD_OPTIONS_INIT \
  { sizeof(vsplat_scene_load_options), 0 }

/* Like vsplat_scene_load, with options; NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load_with(const char* path,
                                                                 const vsplat_scene_load_options* options,
                                                                 vsplat_scene* out_scene);
/* Like vsplat_scene_load_with, from the bytes of a file. They are only read during the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load_memory(const void* bytes, size_t size,
                                                                   const vsplat_scene_load_options* options,
                                                                   vsplat_scene* out_scene);

/* Makes a scene from values in memory, which are copied. Read from `info` are count, sh_degree, near_plane (0: 0.2),
   mirror, up (of any length), offset, surfels, detail and antialias. Of `arrays`, none may be NULL. Rotations may have
   any length but 0, scales may not be negative, opacities lie in [0,1], and every value is finite; VSPLAT_ERROR_INPUT
   names the first that breaks this. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_create(const vsplat_scene_info* info,
                                                              const vsplat_gaussians* arrays, vsplat_scene* out_scene);
/* Replaces values of the same Gaussians, checked and copied as in vsplat_scene_create; arrays that are NULL stay
   unchanged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_update(vsplat_scene scene, const vsplat_gaussians* arrays);

/* Four calls that change a scene in place, each completely or not at all. A call that draws or saves the scene uses its
   state from when that call began. Only one thread at a time may change it. `transform` [4][4], row by row, is a
   rotation times a scale, and a translation, in the world. */

/* Adds the Gaussians of `other`, which is unchanged. `transform` moves them; NULL: they stay in place. To draw several
   scenes in one picture, append each to an empty scene (vsplat_scene_create with a count of 0). The result has the
   higher sh_degree and the nearer near plane; up, offset and detail are those of `scene`, or of `other` if `scene` is
   empty. VSPLAT_ERROR_INPUT: one has surfels and the other has not. If only one has `antialias`, a warning says so, and
   the result has that of `scene`. If only one has a mirror, or the mirrors differ, the result has none, and colours that
   depend on the direction stay as seen from far away. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_append(vsplat_scene scene, vsplat_scene other,
                                                              const double transform[16]);
/* Moves the whole scene, with its mirror, up direction and detail. The near plane is scaled too. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_transform(vsplat_scene scene, const double transform[16]);
/* Removes the Gaussians for which `removed` [count] is not 0; `count` must be the scene's. The others keep their
   order. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_remove(vsplat_scene scene, const uint8_t* removed, size_t count);
/* Keeps the Gaussians whose means lie in the box from `low` to `high`, in the world. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_crop(vsplat_scene scene, const double low[3],
                                                            const double high[3]);

/* Writes a file that vsplat_scene_load reads, in the format of the path's ending, whole or not at all; replaces an
   existing file. VSPLAT_ERROR_USAGE lists the endings if it is another one. If the scene has an offset, positions in the
   file are relative to it. A comment in a PLY states the offset for vsplat_scene_load, and SCENE.offset.json, written
   beside it, states it for other programs. If the scene has no offset, a SCENE.offset.json that an earlier scene of this
   name has left is removed. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save(vsplat_scene scene, const char* path);

typedef struct vsplat_scene_save_options {
  size_t size;
  const char* format;  /* vsplat_scene_format.name; NULL: by the path's ending, and a PLY in memory */
  int32_t spz_version; /* 2 to 4; 0: 4 */
} vsplat_scene_save_options;
#define VSPLAT_SCENE_SAVE_OPTIONS_INIT \
  { sizeof(vsplat_scene_save_options), NULL, 0 }
/* Like vsplat_scene_save, with options; NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_with(vsplat_scene scene, const char* path,
                                                                 const vsplat_scene_save_options* options);
/* The bytes of the PLY that vsplat_scene_save writes, `*out_size` of them. They belong to the caller; free them with
   vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_memory(vsplat_scene scene, char** out_bytes,
                                                                   size_t* out_size);
/* Like vsplat_scene_save_memory, in any format; NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_memory_with(vsplat_scene scene,
                                                                        const vsplat_scene_save_options* options,
                                                                        char** out_bytes, size_t* out_size);
/* What a file in `format` (vsplat_scene_format.name) would lose of this scene: an English sentence a line, empty if it
   keeps all. Free it with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_losses(vsplat_scene scene, const char* format,
                                                                  char** out_text);
/* Converts a scene of surfels, which are flat, to one of Gaussians, for programs that do not support surfels. Each gets
   a third standard deviation, across its plane, of `thickness` times the smaller of its two (above 0, at most 1).
   VSPLAT_ERROR_USAGE: the scene is not one of surfels. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_surfels_to_gaussians(vsplat_scene scene, double thickness,
                                                                            vsplat_scene* out_scene);
VSPLAT_API void vsplat_scene_retain(vsplat_scene scene);
VSPLAT_API void vsplat_scene_release(vsplat_scene scene);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_info(vsplat_scene scene, vsplat_scene_info* out_info);
/* Copies the Gaussians out. VSPLAT_ERROR_USAGE: they do not fit into the arrays. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_gaussians(vsplat_scene scene,
                                                                     const vsplat_gaussians* arrays);
/* The voxels selected when the scene was made, ascending, as indices (i R + j) R + k with i along x; empty for a scene
   from a file. *out_count is how many there are; as many as fit `capacity` are written (out_voxels may be NULL with
   `capacity` 0). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_selection(vsplat_scene scene, int32_t* out_voxels,
                                                                     size_t capacity, size_t* out_count);
/* Writes that list as text, whole or not at all. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_selection(vsplat_scene scene, const char* path);

#ifdef __cplusplus
}
#endif

#endif
