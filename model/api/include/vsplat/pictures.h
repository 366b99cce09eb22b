/* Uses of rendered pictures: contact sheets, animations, comparisons with given pictures. Part of vsplat.h, which
   includes this file and states the common conventions: handles, statuses, structs that begin with their size, pictures
   as sRGB-encoded floats. */
#ifndef VSPLAT_PICTURES_H
#define VSPLAT_PICTURES_H

#include <vsplat/render.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* -------------------------------------------------------------------------------------------------- contact sheets */

/* A contact sheet: many pictures in one, scaled down, side by side in rows, on light grey. Belongs to no device. */
typedef struct vsplat_sheet_impl* vsplat_sheet;

typedef struct vsplat_sheet_options {
  size_t size;
  int32_t cell;     /* the most pixels of a picture's longer side; 0: 256, less if many pictures are expected */
  int32_t columns;  /* 0: as many as make the sheet about 4 : 3 */
  int32_t expected; /* number of pictures that will be added; 0: unknown */
} vsplat_sheet_options;
#define VSPLAT_SHEET_OPTIONS_INIT \
  { sizeof(vsplat_sheet_options), 0, 0, 0 }

/* `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_create(const vsplat_sheet_options* options,
                                                              vsplat_sheet* out_sheet);
VSPLAT_API void vsplat_sheet_retain(vsplat_sheet sheet);
VSPLAT_API void vsplat_sheet_release(vsplat_sheet sheet);
/* Adds the next picture, of any size. Only `colour` is read; it is stored scaled down. Small pictures are not
   enlarged. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_add(vsplat_sheet sheet, const vsplat_picture* picture,
                                                           int32_t width, int32_t height);
/* Like vsplat_sheet_add, with a line of text below the picture: printable ASCII in glyphs of 6 x 10 pixels, cut at the
   picture's width; `label` NULL: none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_add_labelled(vsplat_sheet sheet, const vsplat_picture* picture,
                                                                    int32_t width, int32_t height, const char* label);
/* Writes all pictures added, row by row, as 8-bit PNG, whole or not at all; replaces an existing file.
   VSPLAT_ERROR_USAGE: no picture was added. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_sheet_save(vsplat_sheet sheet, const char* path);

/* ------------------------------------------------------------------------------------------------------ animations */

/* A sequence of pictures, written as animated WebP or GIF that plays in a loop. Belongs to no device. */
typedef struct vsplat_animation_impl* vsplat_animation;

typedef enum vsplat_animation_format {
  VSPLAT_ANIMATION_WEBP = 0,
  VSPLAT_ANIMATION_GIF = 1 /* 256 colours for each picture, dithered; VSPLAT_ERROR_USAGE if the build left it out */
} vsplat_animation_format;

typedef struct vsplat_animation_options {
  size_t size;
  double fps;      /* pictures per second, 0.1 to 100, with GIF to 50 */
  int32_t quality; /* of WebP, 1 to 100; 100: lossless */
  int32_t format;  /* vsplat_animation_format */
} vsplat_animation_options;
#define VSPLAT_ANIMATION_OPTIONS_INIT \
  { sizeof(vsplat_animation_options), 24.0, 90, VSPLAT_ANIMATION_WEBP }

/* `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_create(const vsplat_animation_options* options,
                                                                  vsplat_animation* out_animation);
VSPLAT_API void vsplat_animation_retain(vsplat_animation animation);
VSPLAT_API void vsplat_animation_release(vsplat_animation animation);
/* Adds the next picture. Only `colour` is read; it is encoded at once. VSPLAT_ERROR_INPUT: its size differs from the
   first picture's, or a side exceeds 16383 pixels. VSPLAT_ERROR_USAGE: the animation was saved already. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_add(vsplat_animation animation,
                                                               const vsplat_picture* picture, int32_t width,
                                                               int32_t height);
/* Writes the file, whole or not at all; replaces an existing file. Equal pictures give equal bytes. VSPLAT_ERROR_USAGE:
   no picture was added. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_animation_save(vsplat_animation animation, const char* path);

/* ----------------------------------------------------------------------------------------------------- comparisons */

/* Finds the picture in `folder` that belongs to camera `index`, as vsplat_views_load finds one in its `pictures`, or by
   the index in four digits ("0007") if the list names no file. *out_path becomes "" if there is none; the log then says
   where it was searched. `folder` NULL: the picture that vsplat_cameras_load found beside the list or in the pictures'
   folder of a COLMAP model, without a word in the log if there is none. VSPLAT_ERROR_INPUT: several files match. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_find_picture(vsplat_cameras cameras, size_t index,
                                                                      const char* folder, char** out_path);

/* A picture file's size in pixels, from its header. Either out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_file_size(const char* path, int32_t* out_width,
                                                                   int32_t* out_height);

/* What took a picture, by its file's EXIF data: maker, model, lens and focal lengths, separated by ", ". Pictures of
   one size with the same text have the same intrinsics. "" if the file does not state them. Free it with
   vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_file_lens(const char* path, char** out_text);

/* The size as camera `index` saw the picture: turned by the file's EXIF orientation, if the camera's list describes
   turned pictures. Either out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_get_picture_size(vsplat_cameras cameras, size_t index,
                                                                          const char* path, int32_t* out_width,
                                                                          int32_t* out_height);

/* Reads the picture at `path` as camera `index` would have seen it drawn, into float [height][width][3] of the caller's
   `capacity` floats. Its alpha, and the mask listed with the camera, composite it over `background`. The lens
   distortion listed with the camera is undone, and the picture is turned as in vsplat_cameras_get_picture_size.
   VSPLAT_ERROR_INPUT: picture or mask have another shape. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_load_picture(vsplat_cameras cameras, size_t index,
                                                                      const char* path, int32_t width, int32_t height,
                                                                      const float background[3], float* out_pixels,
                                                                      size_t capacity);

typedef struct vsplat_comparison {
  size_t size;
  double psnr;    /* dB for a peak of 1, over all pixels and channels; infinite for equal pictures */
  double ssim;    /* 11 x 11 Gaussian windows (sigma 1.5) that lie wholly inside; NaN if a side is under 11 pixels */
  double psnr_cc; /* PSNR after colour correction: the affine map of colours, 3 x 3 factors and 3 offsets, that brings
                     `pixels` nearest to `reference` by the squared error, clamped to [0,1] */
} vsplat_comparison;
#define VSPLAT_COMPARISON_INIT \
  { sizeof(vsplat_comparison), 0.0, 0.0, 0.0 }

/* Compares float [height][width][3] pictures, values clamped to [0,1]. `out_difference` receives their absolute
   difference, of the same shape; NULL if not wanted. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_compare(const float* pixels, const float* reference, int32_t width,
                                                         int32_t height, vsplat_comparison* out_comparison,
                                                         float* out_difference);

#ifdef __cplusplus
}
#endif

#endif
