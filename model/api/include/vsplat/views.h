/* From posed photographs to the network's input: cameras, views and the prepared input. Part of vsplat.h, which states
   the common conventions. */
#ifndef VSPLAT_VIEWS_H
#define VSPLAT_VIEWS_H

#include <vsplat/model.h>
#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* ---------------------------------------------------------------------------------------------------------- cameras */

/* Lens distortion model, from undistorted normalised (x, y) to distorted, as defined by COLMAP, OpenCV and
   nerfstudio. */
typedef enum vsplat_lens {
  VSPLAT_LENS_PINHOLE = 0,
  VSPLAT_LENS_OPENCV = 1, /* k1 k2 p1 p2 k3 k4 k5 k6: COLMAP's SIMPLE_RADIAL to FULL_OPENCV, with zeros */
  VSPLAT_LENS_FISHEYE = 2 /* k1 k2 k3 k4: theta (1 + k1 theta^2 + k2 theta^4 + ...) */
} vsplat_lens;

/* Embedded in other structs, so it never grows. */
typedef struct vsplat_camera {
  size_t size;
  int32_t width, height; /* pixels */
  double fx, fy, cx, cy; /* pixels */
  double w2c[16];        /* row-major [4][4] rigid transform, world to camera */
  vsplat_lens lens;      /* of a photograph, which is undistorted when it is read; rendered pictures have none */
  double lens_values[8]; /* in the order above, then zeros */
} vsplat_camera;
#define VSPLAT_CAMERA_INIT                                                                             \
  {                                                                                                    \
    sizeof(vsplat_camera), 0, 0, 0.0, 0.0, 0.0, 0.0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, \
        VSPLAT_LENS_PINHOLE, {                                                                         \
      0, 0, 0, 0, 0, 0, 0, 0                                                                           \
    }                                                                                                  \
  }

typedef struct vsplat_cameras_impl* vsplat_cameras;

/* Reads every camera of a transforms.json, a cameras.json or a COLMAP model, or of the folder that holds one, as
   pinholes. Pictures are not needed. `width` and `height`: the size for cameras whose file gives none; 0: a missing
   size is an error. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_load(const char* path, int32_t width, int32_t height,
                                                              vsplat_cameras* out_cameras);

typedef struct vsplat_cameras_options {
  size_t size;
  int32_t width, height; /* the size for cameras whose file gives none; 0: a missing size is an error */
  int32_t skip_bad;      /* 1: skips unusable cameras, with one warning that counts them; 0: they are an error */
} vsplat_cameras_options;
#define VSPLAT_CAMERAS_OPTIONS_INIT \
  { sizeof(vsplat_cameras_options), 0, 0, 0 }

/* Like vsplat_cameras_load, with options; NULL: defaults. Also reads a camera_path.json of nerfstudio's viewer. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_load_with(const char* path,
                                                                   const vsplat_cameras_options* options,
                                                                   vsplat_cameras* out_cameras);
/* Makes a list from `count` (at least 1) pinhole cameras in memory, which are copied. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_create(const vsplat_camera* cameras, size_t count,
                                                                vsplat_cameras* out_cameras);
/* Points a camera: out_camera->w2c becomes that of a camera at `eye` that looks at `target` with `up` upwards in the
   picture, each three numbers in the world; its other fields stay unchanged. VSPLAT_ERROR_INPUT: the pose is undefined,
   because `eye` equals `target` or `up` lies along the view. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_camera_look_at(const double* eye, const double* target,
                                                                const double* up, vsplat_camera* out_camera);
VSPLAT_API void vsplat_cameras_retain(vsplat_cameras cameras);
VSPLAT_API void vsplat_cameras_release(vsplat_cameras cameras);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_count(vsplat_cameras cameras, size_t* out_count);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_get(vsplat_cameras cameras, size_t index,
                                                             vsplat_camera* out_camera);
/* Makes `count` (1 to 10000) cameras on a smooth path through `keys`, in their order. Centres follow a cubic spline
   through the keys' centres, rotations the shorter arcs; fields of view and principal points are interpolated; pictures
   have the first key's size. The first and the last camera are the first and the last key; with one key or one camera,
   all are the first key. If the keys' optical axes meet at or near a point that all keys see, as with cameras about an
   object, the path goes round that point and keeps it in the picture. VSPLAT_ERROR_INPUT: a key's picture has another
   aspect ratio than the first one's. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_path(vsplat_cameras keys, int32_t count,
                                                              vsplat_cameras* out_cameras);

/* Writes cameras as a cameras.json that vsplat_cameras_load and vsplat_views_load read back equal to the bit; whole or
   not at all; replaces an existing file. `files`: [count] the pictures' paths relative to the file's folder; NULL:
   0000.png, 0001.png, ... */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_save(const vsplat_camera* cameras, size_t count,
                                                              const char* const* files, const char* path);

/* ------------------------------------------------------------------------------------------------------------ views */

/* Posed photographs as they were taken, before any are chosen; read lazily from files, or held in memory. */
typedef struct vsplat_views_impl* vsplat_views;

/* Value type of a picture in memory, in the machine's byte order. */
typedef enum vsplat_pixel_type {
  VSPLAT_PIXELS_F32 = 0, /* 0 to 1 */
  VSPLAT_PIXELS_F16 = 1, /* IEEE half precision, 0 to 1 */
  VSPLAT_PIXELS_U8 = 2   /* 0 to 255 */
} vsplat_pixel_type;

typedef struct vsplat_view {
  size_t size;
  vsplat_camera camera;   /* of the whole picture */
  const float* pixels;    /* [height][width][channels], 0 to 1; copied. NULL if `data` holds them */
  int32_t channels;       /* 3: RGB; 4: RGBA, composited to white */
  vsplat_pixel_type type; /* of `data` */
  const void* data;       /* [height] rows of [width][channels] values; copied. NULL if `pixels` holds them */
  size_t row_bytes;       /* bytes from a row of `data` to the next; 0: rows without padding */
  int32_t premultiplied;  /* 1: colour has been multiplied by alpha; 0: alpha is straight */
  size_t data_bytes;      /* size of `data` in bytes: VSPLAT_ERROR_USAGE if its rows need more. 0: unknown */
} vsplat_view;
#define VSPLAT_VIEW_INIT \
  { sizeof(vsplat_view), VSPLAT_CAMERA_INIT, NULL, 3, VSPLAT_PIXELS_F32, NULL, 0, 0, 0 }

/* Reads the list of views at `path`: a transforms.json, a cameras.json, a COLMAP model or a folder holding one.
   `pictures`: the folder of the pictures, or NULL to search where the list says. A picture is searched by its listed
   path, then by ever shorter ends of that path, then by its stem with another extension or case; two matches are
   VSPLAT_ERROR_INPUT. If a folder holds several of transforms_train.json, transforms_val.json and transforms_test.json,
   the first of them in this order is read. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_load(const char* path, const char* pictures,
                                                            vsplat_views* out_views);
typedef struct vsplat_views_options {
  size_t size;
  const char* pictures; /* the folder of the pictures; NULL: where the list says */
  int32_t skip_bad;     /* 1: skips views with an unusable pose, camera, picture or mask, with one warning that counts
                           them; this reads all pictures once. 0: the first one is an error */
  int32_t check_later;  /* 1, without skip_bad: a bad pose or camera is an error only when its view is used */
} vsplat_views_options;
#define VSPLAT_VIEWS_OPTIONS_INIT \
  { sizeof(vsplat_views_options), NULL, 0, 0 }

/* Like vsplat_views_load, with options; NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_load_with(const char* path, const vsplat_views_options* options,
                                                                 vsplat_views* out_views);
/* Makes views from pictures in memory. Pixel values up to 0.5 outside 0 to 1, as resampling produces, are clamped;
   values further outside and NaN are VSPLAT_ERROR_INPUT, naming view, pixel and value. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_create(const vsplat_view* views, size_t num_views,
                                                              vsplat_views* out_views);
VSPLAT_API void vsplat_views_retain(vsplat_views views);
VSPLAT_API void vsplat_views_release(vsplat_views views);
/* Number of listed views, with or without a picture. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_count(vsplat_views views, size_t* out_count);
/* The most bytes of host memory that reading all of their pictures takes; reads the files' headers. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_memory(vsplat_views views, uint64_t* out_bytes);
/* Name of view `index` in its list: its picture's path, or the index of a picture in memory. Free it with
   vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_name(vsplat_views views, size_t index, char** out_text);
/* The files that the views are read from, one a line: the list, and its existing pictures and masks. Empty for pictures
   in memory. Free it with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_files(vsplat_views views, char** out_text);

/* ------------------------------------------------------------------------------------------------------------ input */

/* The chosen views as the network sees them: cropped, resampled, undistorted, on white, with the object's cube
   placed. */
typedef struct vsplat_input_impl* vsplat_input;

typedef enum vsplat_crop {
  VSPLAT_CROP_AUTO = 0,   /* resamples square pictures, crops others as OBJECT */
  VSPLAT_CROP_OBJECT = 1, /* the square about the cube's projected centre that spans 1.5 of its edges */
  VSPLAT_CROP_CROP = 2,   /* the centre square */
  VSPLAT_CROP_PAD = 3     /* the whole picture, padded with white */
} vsplat_crop;

typedef struct vsplat_input_options {
  size_t size;
  const char* const* names; /* [num_names] views by name (stem or path) or "@index"; the first is the reference view;
                               NULL: `view_count` of them by k-means over the cameras, or all */
  size_t num_names;
  int32_t has_center; /* 1: `center` is set */
  double center[3];   /* centre of the object's cube, in the world */
  double scale;       /* the cube's edge in world units; 0: not set */
  int32_t auto_frame; /* 1: estimates what is not set: from the points that come with the views, else from masks, else
                         from the cameras' axes; 0: estimates only what the file does not list either */
  vsplat_crop crop;
  int32_t force;      /* 1: continues even if the cube seems to be behind or outside most views */
  int32_t view_count; /* how many views are picked if there are more and `names` is NULL, from 1 to the model's
                         max_views; 0: the model's use_views */
} vsplat_input_options;
#define VSPLAT_INPUT_OPTIONS_INIT \
  { sizeof(vsplat_input_options), NULL, 0, 0, {0, 0, 0}, 0.0, 0, VSPLAT_CROP_AUTO, 0, 0 }

typedef struct vsplat_input_info {
  size_t size;
  int32_t views;
  int32_t image;    /* pixels along an edge */
  double center[3]; /* centre of the cube, as placed */
  double scale;
  double up[3]; /* up direction in the world, of length 1, from all listed cameras: perpendicular to their horizontal
                   axes, or the nearest world axis if the cameras are rolled too much to determine it */
} vsplat_input_info;
#define VSPLAT_INPUT_INFO_INIT                                   \
  {                                                              \
    sizeof(vsplat_input_info), 0, 0, {0, 0, 0}, 0.0, { 0, 0, 0 } \
  }

/* Chooses the views, places the cube, checks both, and prepares the pictures for `model`. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_prepare(vsplat_model model, vsplat_views views,
                                                               const vsplat_input_options* options,
                                                               vsplat_input* out_input);
VSPLAT_API void vsplat_input_retain(vsplat_input input);
VSPLAT_API void vsplat_input_release(vsplat_input input);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_info(vsplat_input input, vsplat_input_info* out_info);
/* The camera of view `index` in the user's world, for the cropped and resampled picture. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_camera(vsplat_input input, size_t index,
                                                                  vsplat_camera* out_camera);
/* Copies the picture of view `index`, float [image][image][3], into the caller's memory of `capacity` floats. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_picture(vsplat_input input, size_t index, float* out_pixels,
                                                                   size_t capacity);
/* The files that vsplat_input_save would write to `folder`, one a line. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_files(vsplat_input input, const char* folder,
                                                                 char** out_text);
/* Writes the pictures as 8-bit PNG files, and their cameras.json, to `folder`, which is created if missing and can then
   be read like any other. Replaces existing files. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_save(vsplat_input input, const char* folder);

#ifdef __cplusplus
}
#endif

#endif
