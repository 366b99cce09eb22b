/* What is made of drawn pictures: contact sheets, animations, comparisons with given ones. Part of vsplat.h, which
   includes it and whose conventions hold: handles, statuses, structs with their size, pictures as sRGB-encoded floats.
 */
#ifndef VSPLAT_PICTURES_H
#define VSPLAT_PICTURES_H

#include <vsplat/render.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* -------------------------------------------------------------------------------------------------- contact sheets */

/* Many pictures as one: scaled down, side by side in rows, on light grey. Belongs to no device. */
typedef struct vsplat_sheet_impl* vsplat_sheet;

typedef struct vsplat_sheet_options {
  size_t size;
  int32_t cell; /* pixels that a picture's longer side takes at most; 0: 256, less where many pictures are expected */
  int32_t columns;  /* 0: so many that the sheet is about 4 : 3 */
  int32_t expected; /* how many pictures are going to be added; 0: unknown */
} vsplat_sheet_options;
#define VSPLAT_SHEET_OPTIONS_INIT \
  { sizeof(vsplat_sheet_options), 0, 0, 0 }

/* `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_create(const vsplat_sheet_options* options,
                                                              vsplat_sheet* out_sheet);
VSPLAT_API void vsplat_sheet_retain(vsplat_sheet sheet);
VSPLAT_API void vsplat_sheet_release(vsplat_sheet sheet);
/* The next picture, of any size: `colour` alone is read, and kept scaled down; small ones are not enlarged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_add(vsplat_sheet sheet, const vsplat_picture* picture,
                                                           int32_t width, int32_t height);
/* The same with a line of text below it, printable ASCII in glyphs of 6 x 10 pixels, cut where it is longer than the
   picture is wide; `label` NULL: none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_add_labelled(vsplat_sheet sheet, const vsplat_picture* picture,
                                                                    int32_t width, int32_t height, const char* label);
/* Writes all that were added, row by row, as 8-bit PNG, whole or not at all; an existing file is replaced.
   VSPLAT_ERROR_USAGE where there are none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_save(vsplat_sheet sheet, const char* path);

/* ------------------------------------------------------------------------------------------------------ animations */

/* Pictures one after the other, as animated WebP that plays in a loop. Belongs to no device. */
typedef struct vsplat_animation_impl* vsplat_animation;

typedef struct vsplat_animation_options {
  size_t size;
  double fps;      /* pictures per second, 0.1 to 100 */
  int32_t quality; /* 1 to 100; 100: without loss */
} vsplat_animation_options;
#define VSPLAT_ANIMATION_OPTIONS_INIT \
  { sizeof(vsplat_animation_options), 24.0, 90 }

/* `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_create(const vsplat_animation_options* options,
                                                                  vsplat_animation* out_animation);
VSPLAT_API void vsplat_animation_retain(vsplat_animation animation);
VSPLAT_API void vsplat_animation_release(vsplat_animation animation);
/* The next picture: `colour` alone is read, and encoded at once. All of one size, 16383 pixels to a side at most, else
   VSPLAT_ERROR_INPUT. VSPLAT_ERROR_USAGE once the animation was saved. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_add(vsplat_animation animation,
                                                               const vsplat_picture* picture, int32_t width,
                                                               int32_t height);
/* Writes the file, whole or not at all; an existing one is replaced. The same pictures give the same bytes.
   VSPLAT_ERROR_USAGE where there are none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_save(vsplat_animation animation, const char* path);

/* ----------------------------------------------------------------------------------------------------- comparisons */

/* The picture of `folder` that belongs to camera `index`, found as vsplat_views_load finds one in its `pictures`; by
   the index in four digits ("0007") where the list named no file. *out_path is "" where there is none, and the log tells
   where it was looked for. VSPLAT_ERROR_INPUT where several fit. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_find_picture(vsplat_cameras cameras, size_t index,
                                                                      const char* folder, char** out_path);

/* A picture file's size in pixels, from its header. Either out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_file_size(const char* path, int32_t* out_width,
                                                                   int32_t* out_height);

/* The same as camera `index` saw it: turned as the file's EXIF data say, where its list is of turned pictures. Either
   out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_get_picture_size(vsplat_cameras cameras, size_t index,
                                                                          const char* path, int32_t* out_width,
                                                                          int32_t* out_height);

/* The picture at `path` as camera `index` would have seen it drawn, into float [height][width][3] of the caller's
   `capacity` floats: its alpha, and the mask that the camera was listed with, over `background`; the lens distortion
   that the camera was listed with undone, and turned as vsplat_cameras_get_picture_size has it. VSPLAT_ERROR_INPUT where
   picture or mask have another shape. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_load_picture(vsplat_cameras cameras, size_t index,
                                                                      const char* path, int32_t width, int32_t height,
                                                                      const float background[3], float* out_pixels,
                                                                      size_t capacity);

typedef struct vsplat_comparison {
  size_t size;
  double psnr; /* dB for a peak of 1, over all pixels and channels; infinite for equal pictures */
  double ssim; /* 11 x 11 Gaussian windows (sigma 1.5) wholly inside; NaN where a side is under 11 pixels */
} vsplat_comparison;
#define VSPLAT_COMPARISON_INIT \
  { sizeof(vsplat_comparison), 0.0, 0.0 }

/* Compares float [height][width][3] pictures, values clamped to [0,1]. `out_difference`: their absolute difference, of
   the same shape; NULL where not wanted. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_compare(const float* pixels, const float* reference, int32_t width,
                                                         int32_t height, vsplat_comparison* out_comparison,
                                                         float* out_difference);

#ifdef __cplusplus
}
#endif

#endif
