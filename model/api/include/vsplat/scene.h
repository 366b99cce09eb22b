/* Scenes: Gaussians and how they are meant to be drawn.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_SCENE_H
#define VSPLAT_SCENE_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Gaussians in one frame, with how they are meant to be drawn. */
typedef struct vsplat_scene_impl* vsplat_scene;

typedef struct vsplat_scene_info {
  size_t size;
  uint64_t count;     /* Gaussians */
  int32_t sh_degree;  /* 0 to 3 */
  double near_plane;  /* world units */
  int32_t has_mirror; /* 1: view-dependent colour is meant as seen from the camera's mirror image about `mirror` */
  double mirror[3];   /* relative to `offset` */
  /* Gaussians of the file that vsplat_scene_load_with left out with `skip_bad`, by reason. */
  uint64_t skipped_not_finite; /* a value is NaN or infinite; an infinite opacity logit is opacity 0 or 1, and taken */
  uint64_t skipped_huge_scale; /* a scale's exponential is beyond what a float holds */
  uint64_t skipped_zero_rotation; /* the quaternion's length is 0 */
  double up[3];                   /* which way is up, of length 1; 0, 0, 0: not known */
  /* Where in the world the means begin: what vsplat_gaussians.means holds, and `mirror`, plus this is the world. It is
     0, 0, 0 but for an object so far from the world's origin that floats would not hold it to 1e-4 of its cube's edge.
     Cameras are in the world in any case. */
  double offset[3];
  int32_t surfels; /* 1: flat, scales[2] of each is 0 and its third axis is its normal; 0: volumes of three scales */
  /* How wide, in the world, a pixel is at `detail_middle` of the pictures that the scene was made from, by which
     vsplat_render_options.supersample chooses where it is 0; 0: not known, one sample a pixel. */
  double detail_pixel;
  double detail_middle[3]; /* the object's middle, relative to `offset` */
} vsplat_scene_info;
#define VSPLAT_SCENE_INFO_INIT                                                                             \
  {                                                                                                        \
    sizeof(vsplat_scene_info), 0, 0, 0.0, 0, {0, 0, 0}, 0, 0, 0, {0, 0, 0}, {0, 0, 0}, 0, 0.0, { 0, 0, 0 } \
  }

/* Arrays of the caller, any of them NULL where not wanted; K Gaussians, S = (sh_degree + 1)^2. */
typedef struct vsplat_gaussians {
  size_t size;
  uint64_t capacity; /* Gaussians that fit into every array */
  float* means;      /* [K][3] world, relative to vsplat_scene_info.offset */
  float* scales;     /* [K][3] standard deviations, world units; of surfels the third is 0 */
  float* rotations;  /* [K][4] quaternions w, x, y, z; of length 1 unless the caller gave others */
  float* opacities;  /* [K] in [0,1] */
  float* sh;         /* [K][S][3] colour = max(0, 0.5 + basis . sh), in the basis of 3DGS files */
} vsplat_gaussians;
#define VSPLAT_GAUSSIANS_INIT \
  { sizeof(vsplat_gaussians), 0, NULL, NULL, NULL, NULL, NULL }

/* A standard 3DGS PLY, binary or ASCII; or one of surfels, as 2DGS has them: with two scales each. VSPLAT_ERROR_FORMAT
   names the Gaussian, the property and the byte of the first value that cannot be drawn; bytes that nothing in the
   header accounts for are a warning. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load(const char* path, vsplat_scene* out_scene);

typedef struct vsplat_scene_load_options {
  size_t size;
  int32_t skip_bad; /* 1: single Gaussians that cannot be drawn are left out and counted (vsplat_scene_info) */
} vsplat_scene_load_options;
#define VSPLAT_SCENE_LOAD_OPTIONS_INIT \
  { sizeof(vsplat_scene_load_options), 0 }

/* The same with options; NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load_with(const char* path,
                                                                 const vsplat_scene_load_options* options,
                                                                 vsplat_scene* out_scene);
/* The same of a PLY file's bytes, which are only read during the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_load_memory(const void* bytes, size_t size,
                                                                   const vsplat_scene_load_options* options,
                                                                   vsplat_scene* out_scene);

/* From values in memory, which are copied. Of `info`, its count, sh_degree, near_plane (0: 0.2), mirror, up (of any
   length), offset, surfels and detail are taken.
   Of `arrays`, none may be NULL: rotations of any length but 0, scales not negative, opacities in [0,1], every value
   finite; VSPLAT_ERROR_INPUT names the first that is not. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_create(const vsplat_scene_info* info,
                                                              const vsplat_gaussians* arrays, vsplat_scene* out_scene);
/* New values for the same Gaussians, checked and copied in the same way; arrays that are NULL stay as they were. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_update(vsplat_scene scene, const vsplat_gaussians* arrays);

/* Four changes of a scene in place, each made whole or not at all. A call that draws or saves the scene goes on with
   what it was when that call began; one thread at a time changes it. `transform` [4][4], row by row, is a rotation times a
   scale, and a shift, in the world. */

/* Adds the Gaussians of `other`, which stays as it is. `transform` moves them; NULL: they are where they were. So
   several scenes come into one picture: append each to an empty scene (vsplat_scene_create with a count of 0), and draw
   that. The higher sh_degree and the nearer near plane are kept; up, offset and detail are those of `scene`, or of
   `other` where `scene` is empty. VSPLAT_ERROR_INPUT where one has surfels and the other has not. Where only one of them
   has a mirror, or they have different ones, none is left, and colours that depend on the direction are kept as seen
   from far away. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_append(vsplat_scene scene, vsplat_scene other,
                                                              const double transform[16]);
/* Moves all of it, with its mirror, up and detail. The near plane is scaled, too. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_transform(vsplat_scene scene, const double transform[16]);
/* Takes Gaussians away: those of which `removed` [count] is not 0. `count` is that of the scene. The others keep their
   order. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_remove(vsplat_scene scene, const uint8_t* removed, size_t count);
/* Keeps the Gaussians whose means lie in the box from `low` to `high`, in the world. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_crop(vsplat_scene scene, const double low[3],
                                                            const double high[3]);

/* Writes one, whole or not at all. An existing file is replaced. Where the scene has an offset, positions in the file
   are relative to it: a comment of the file says so to vsplat_scene_load, and SCENE.offset.json beside it, which is
   written, too, to other programs. Where it has none, such a file of an earlier scene of this name is removed. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save(vsplat_scene scene, const char* path);
/* The bytes of that file, `*out_size` of them; the caller's, to be freed by vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_memory(vsplat_scene scene, char** out_bytes,
                                                                   size_t* out_size);
/* A scene of surfels, which are flat, as one of Gaussians for programs that know no surfels: each gets a third
   deviation, across its plane, of `thickness` times the smaller of its two (above 0, at most 1). VSPLAT_ERROR_USAGE
   where the scene is not one of surfels. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_surfels_to_gaussians(vsplat_scene scene, double thickness,
                                                                            vsplat_scene* out_scene);
VSPLAT_API void vsplat_scene_retain(vsplat_scene scene);
VSPLAT_API void vsplat_scene_release(vsplat_scene scene);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_info(vsplat_scene scene, vsplat_scene_info* out_info);
/* Copies the Gaussians out. VSPLAT_ERROR_USAGE where they do not fit. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_gaussians(vsplat_scene scene,
                                                                     const vsplat_gaussians* arrays);
/* The voxels that were selected when the scene was made, ascending, as index (i R + j) R + k with i along x; none for a
   scene from a file. *out_count is how many there are; as many as fit `capacity` are written (out_voxels may be NULL
   with capacity 0). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_selection(vsplat_scene scene, int32_t* out_voxels,
                                                                     size_t capacity, size_t* out_count);
/* Writes that list as text, whole or not at all. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save_selection(vsplat_scene scene, const char* path);

#ifdef __cplusplus
}
#endif

#endif
