/* Scenes as a whole: filtered, turned, reduced, described and compared. Part of vsplat.h, which states the common
   conventions. */
#ifndef VSPLAT_SCENE_EDIT_H
#define VSPLAT_SCENE_EDIT_H

#include <vsplat/device.h>
#include <vsplat/scene.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What vsplat_scene_edit does, in this order: removes Gaussians, in the scene's own coordinates and units; turns the
   scene; changes its axes; scales it; moves it; and changes the degree of its spherical harmonics. */
typedef struct vsplat_scene_edit_options {
  size_t size;
  int32_t has_box;         /* 1: keeps the Gaussians whose means lie in the box from `box_low` to `box_high` */
  double box_low[3];       /* in the world */
  double box_high[3];      /* in the world */
  double sphere_radius;    /* world units; above 0: keeps the Gaussians whose means lie in the sphere */
  double sphere_centre[3]; /* in the world */
  double min_opacity;      /* 0 to 1: removes Gaussians of a lower opacity */
  double max_size;         /* world units; above 0: removes Gaussians with a larger standard deviation */
  int32_t remove_floaters; /* 1: removes Gaussians that are alone: the mean distance to the eight nearest others is more
                               than ten times the scene's median of it, and three times their own largest standard
                               deviation */
  double up[3];            /* up direction of the scene as it was, of any length; 0, 0, 0: what the scene says, else
                               that of `from_axes` if it is given */
  int32_t upright;         /* 1: turns the scene about the world's origin, the shortest way, so that its up direction
                               becomes that of `from_axes`. VSPLAT_ERROR_USAGE: the up direction is unknown */
  const char* from_axes;   /* the scene's axes: three letters say where +x, +y and +z point, R or L, U or D, F or B.
                               NULL: "RDF", COLMAP's and 3DGS's */
  const char* to_axes;     /* the axes that it gets; NULL: those of `from_axes`. From right-handed to left-handed axes
                               or back, positions, rotations and colours are mirrored: programs with those axes show
                               the scene as it is */
  double scale;            /* above 0; 0: 1 */
  double translation[3];   /* world units, after scaling */
  int32_t sh_degree;       /* 0 to 4: leaves out higher degrees, or adds zeros; -1: as it is */
} vsplat_scene_edit_options;
#define VSPLAT_SCENE_EDIT_OPTIONS_INIT                                                                                 \
  {                                                                                                                    \
    sizeof(vsplat_scene_edit_options), 0, {0, 0, 0}, {0, 0, 0}, 0.0, {0, 0, 0}, 0.0, 0.0, 0, {0, 0, 0}, 0, NULL, NULL, \
        0.0, {0, 0, 0}, -1                                                                                             \
  }

/* Numbers of Gaussians. One that several rules remove counts with the first of them. */
typedef struct vsplat_scene_edit_result {
  size_t size;
  uint64_t count;                                                            /* of the scene now */
  uint64_t outside_box, outside_sphere, below_opacity, above_size, floaters; /* removed */
  int32_t mirrored; /* 1: the axes changed from one hand to the other */
} vsplat_scene_edit_result;
#define VSPLAT_SCENE_EDIT_RESULT_INIT \
  { sizeof(vsplat_scene_edit_result), 0, 0, 0, 0, 0, 0, 0 }

/* Changes a scene in place, completely or not at all, like vsplat_scene_transform. `out_result` may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_edit(vsplat_scene scene,
                                                            const vsplat_scene_edit_options* options,
                                                            vsplat_scene_edit_result* out_result);

typedef struct vsplat_scene_keep_visible_options {
  size_t size;
  uint64_t max_gaussians;       /* 0: all stay */
  const vsplat_camera* cameras; /* [num_cameras], in the world; NULL: 24 about the scene, eight on each of three circles
                                   at 30 degrees below its middle, 5 and 40 above, with pictures of 512 x 512 pixels */
  size_t num_cameras;
  vsplat_progress_function progress; /* called before each picture */
  void* user;
} vsplat_scene_keep_visible_options;
#define VSPLAT_SCENE_KEEP_VISIBLE_OPTIONS_INIT \
  { sizeof(vsplat_scene_keep_visible_options), 0, NULL, 0, NULL, NULL }

/* Keeps the most visible Gaussians, in their order. A Gaussian's visibility is the sum of its blending weights, alpha
   times the transmittance in front of it, over the pixels of all pictures. Of equally visible ones, the first stay.
   Changes the scene in place, completely or not at all. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_keep_visible(vsplat_device device, vsplat_scene scene,
                                                                    const vsplat_scene_keep_visible_options* options);

/* A scene file, as its beginning describes it. */
typedef struct vsplat_scene_file {
  size_t size;
  const char* format; /* vsplat_scene_format.name; valid while the library is loaded */
  const char* title;  /* the format's name for a reader; valid as long */
  char version[32];   /* as the file states it, "binary_little_endian 1.0"; "": the format has none */
  char axes[8];       /* the axes of positions in the file, as in vsplat_scene_edit_options; "": the format does not
                         define them */
  uint64_t bytes;     /* length of the file */
} vsplat_scene_file;
#define VSPLAT_SCENE_FILE_INIT \
  { sizeof(vsplat_scene_file), NULL, NULL, {0}, {0}, 0 }
/* VSPLAT_ERROR_FORMAT: the file is not a scene. What follows its beginning is not read. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_file_describe(const char* path, vsplat_scene_file* out_file);

/* What a scene's Gaussians are like. Sizes are largest standard deviations, in world units. */
typedef struct vsplat_scene_statistics {
  size_t size;
  uint64_t count;
  uint64_t not_finite;    /* Gaussians with a NaN or an infinity, which count in nothing below */
  uint64_t transparent;   /* opacity below 0.1 */
  uint64_t invisible;     /* opacity below 1/255: pictures do not show them */
  uint64_t huge;          /* size above a tenth of the diagonal of the box from `low_1` to `high_99` */
  uint64_t distant;       /* more than ten times as far from the middle as the median Gaussian; the middle is the median
                           of the means along each axis */
  double low[3], high[3]; /* bounds of the means, in the world; 0 for a scene without Gaussians */
  double low_1[3], high_99[3]; /* 1st and 99th percentiles of the means along each axis */
  double median_opacity;
  double median_size, largest_size;
  uint64_t bytes; /* of the Gaussians in memory, on the host and on a device */
} vsplat_scene_statistics;
#define VSPLAT_SCENE_STATISTICS_INIT \
  { sizeof(vsplat_scene_statistics), 0, 0, 0, 0, 0, 0, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, 0.0, 0.0, 0.0, 0 }
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_statistics(vsplat_scene scene,
                                                                      vsplat_scene_statistics* out_statistics);

/* How far the values of two scenes of the same Gaussians are apart: the largest difference and the root mean square. */
typedef struct vsplat_scene_difference {
  size_t size;
  int32_t in_order;                /* 0: the Gaussians are in another order. Each was compared with the one most like it
                                     among the 16 nearest of the other scene */
  double means, means_rms;         /* distances, world units */
  double scales, scales_rms;       /* standard deviations, world units */
  double rotations, rotations_rms; /* angles, degrees */
  double opacities, opacities_rms;
  double sh, sh_rms; /* coefficients; 0 for those of a degree that one of the scenes lacks */
} vsplat_scene_difference;
#define VSPLAT_SCENE_DIFFERENCE_INIT \
  { sizeof(vsplat_scene_difference), 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 }
/* VSPLAT_ERROR_INPUT: the scenes have different numbers of Gaussians, or only one has surfels. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_get_difference(vsplat_scene scene, vsplat_scene other,
                                                                      vsplat_scene_difference* out_difference);

#ifdef __cplusplus
}
#endif

#endif
