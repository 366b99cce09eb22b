/* A scene drawn: pictures, their gradients, cameras on a circle, files of pictures.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_RENDER_H
#define VSPLAT_RENDER_H

#include <vsplat/device.h>
#include <vsplat/reconstruct.h>
#include <vsplat/scene.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_orbit_options {
  size_t size;
  int32_t count;         /* cameras on the circle */
  int32_t width, height; /* pixels; each 512 where it is 0 */
  double radius;         /* world units; 0: from inputs or scene */
  int32_t has_elevation; /* 1: `elevation` is set */
  double elevation;      /* degrees above the plane across `up` */
  int32_t has_up;        /* 1: `up` is set */
  double up[3];
} vsplat_orbit_options;
#define VSPLAT_ORBIT_OPTIONS_INIT                                      \
  {                                                                    \
    sizeof(vsplat_orbit_options), 8, 0, 0, 0.0, 0, 0.0, 0, { 0, 0, 0 } \
  }

/* A circle about the cube's centre: median distance and elevation of the input views, the input's up axis, and their
   median field of view, or a wider one that holds the cylinder inscribed in the cube with a margin. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_orbit_input(vsplat_input input,
                                                                     const vsplat_orbit_options* options,
                                                                     vsplat_cameras* out_cameras);
/* About the middle of what can be seen of the scene, level, with 50 degrees of field of view, from where a twentieth of
   the picture is left free all the way round; what lies far off (floaters) does not count. Up is the scene's, -y where
   it knows none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_orbit_scene(vsplat_scene scene,
                                                                     const vsplat_orbit_options* options,
                                                                     vsplat_cameras* out_cameras);

typedef struct vsplat_render_options {
  size_t size;
  float background[3]; /* sRGB-encoded */
  double near_plane;   /* world units; 0: the scene's */
  vsplat_progress_function progress;
  void* user;
  int32_t exact_tiles;  /* 1: tiles that a Gaussian's ellipse does not reach are not sorted for it. The same picture to
                          the bit; less work where many Gaussians are long, thin and slanted, a little more elsewhere */
  uint64_t supersample; /* samples along a pixel's edge, 1 to 8: the picture is drawn in so many times its width and
                           height, and averaged. 0: where the scene tells how fine the pictures were that it was made
                           from, and a pixel is two or more times as wide, as many as make it no finer than those, and
                           none beyond 2048 pixels of what is drawn; else 1. Derivatives take 0 and 1, which is none */
} vsplat_render_options;
#define VSPLAT_RENDER_OPTIONS_INIT \
  { sizeof(vsplat_render_options), {1, 1, 1}, 0.0, NULL, NULL, 0, 0 }

/* Arrays of the caller, any of them NULL where not wanted. A call that draws needs at least one. No two of one picture
   may share memory: else VSPLAT_ERROR_USAGE. */
typedef struct vsplat_picture {
  size_t size;
  uint64_t capacity; /* pixels that fit into every array */
  float* colour;     /* [height][width][3] over the background; may exceed 1 */
  float* alpha;      /* [height][width] */
  float* depth;      /* [height][width] accumulated: sum of weight x camera z, world units */
  /* What vsplat_render, vsplat_render_views and vsplat_render_async draw, once more as programs keep pictures; other
     functions do not look at what follows. [height] rows of [width][channels] values; NULL: not wanted */
  void* data;
  vsplat_pixel_type type; /* of `data`; 8 bits are rounded as in PNG files, and limited to 0 to 1 */
  int32_t channels;       /* 3: RGB over the background; 4: RGBA, without the background */
  size_t row_bytes;       /* from a row of `data` to the next; 0: they lie without gaps */
  int32_t premultiplied;  /* 1: colour is multiplied by alpha; 0: alpha is straight */
  size_t data_bytes;      /* how many `data` has: VSPLAT_ERROR_USAGE where its rows need more. 0: not told; `capacity`
                             is then asked for `data`, too */
  /* Where surfaces are, with one sample a pixel whatever the supersampling. Of volumes the host finds `median` and
     `ids`, and draws `normal` from a copy of the scene: dearer than the rest. */
  float* expected; /* [height][width] depth / alpha, which is the depth on average; 0 where alpha is 0 */
  float* median; /* [height][width] camera z of the last Gaussian that met a transmittance over 0.5; 0 where none did */
  float* normal; /* [height][width][3] sum of weight x normal, in the camera's axes and towards it; a Gaussian's normal
                      is its shortest axis */
  int32_t* ids;  /* [height][width] the nearest Gaussian whose alpha is 1/255 or more, as an index into the scene's; -1
                      where there is none. Volumes alone: VSPLAT_ERROR_USAGE for surfels */
} vsplat_picture;
#define VSPLAT_PICTURE_INIT \
  { sizeof(vsplat_picture), 0, NULL, NULL, NULL, NULL, VSPLAT_PIXELS_F32, 3, 0, 0, 0, NULL, NULL, NULL, NULL }

/* Draws the scene from a camera, as the original 3D Gaussian splatting rasteriser defines it. `options` NULL: defaults.
   The scene's Gaussians stay on the device until scene or device go. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render(vsplat_device device, vsplat_scene scene,
                                                        const vsplat_camera* camera,
                                                        const vsplat_render_options* options,
                                                        const vsplat_picture* picture);

/* The same for `count` cameras and as many pictures, which may differ in size. A request that is wrong in any of them
   is refused before the first is drawn; progress is told before each. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_views(vsplat_device device, vsplat_scene scene,
                                                              const vsplat_camera* cameras, size_t count,
                                                              const vsplat_render_options* options,
                                                              const vsplat_picture* pictures);

/* Derivatives of a loss on that picture. `gradient` holds those by the picture's values, shaped as vsplat_render gives
   them; arrays that are NULL count as zeros. `arrays` takes those by the scene's Gaussians, shaped as
   vsplat_scene_get_gaussians gives them: by the scales themselves, by rotations as they are, of whatever length, and by
   opacities, not by a logarithm or a logit; NULL, or arrays of it that are NULL, where not wanted; one at least is, or
   `out_pose`. `out_pose`, where it is not NULL, takes six: by (omega, tau) at 0, where the camera's pose is exp([omega, tau]) times w2c: a turn about
   the camera's axes, in radians, and a shift along them, in world units. The same bits every time. The picture is drawn
   once more to begin with, one sample a pixel. What is written replaces what was there; sums over cameras are the
   caller's.

   They are the derivatives of the picture as it is drawn, with its choices held as they are:
   - which Gaussians a pixel shows, and in which order: one whose alpha there is under 1/255 shows nothing, and its
     derivatives by that pixel are 0, however near to 1/255 it is;
   - where a pixel's ray ends: before the Gaussian that would bring its transmittance under 1e-4;
   - limits: alpha does not change where it is limited to 0.99, nor a colour where it is limited to 0;
   - which Gaussians are left out altogether: those in front of the near plane.
   At these places, and where the tiles end that a Gaussian is drawn in, the picture itself jumps, by up to 1/100 of its
   colour. A difference of two pictures has those jumps in it, and the derivatives have not. The edge where alpha is
   1/255 moves over pixels when mean, scale, rotation or opacity change. Measured with single Gaussians of 5 and of 12
   pixels' deviation, differences by mean, scale and rotation are larger than the derivatives by 2 % at an opacity of
   0.9, by 5 % at 0.3 and by 14 % at 0.1; by opacity it is 0.5 %, 1 % and 4 %; by colours nothing. That is the average,
   the same for steps from 3e-2 to 1e-4. Single differences of a small step scatter: most cross no jump and agree, a few
   are off by their own size or more.

   A test by finite differences can hold derivatives by colours in every scene. All others it can hold in a scene
   without jumps: every Gaussian covers the whole picture with an alpha well above 1/255 and below 0.99, and no pixel
   ends. Central differences with a step of 1e-2 agree to 0.1 % there (scales of 1.5, a picture of 96 x 96 pixels); under
   1e-3 the rounding of floats is seen. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_backward(vsplat_device device, vsplat_scene scene,
                                                                 const vsplat_camera* camera,
                                                                 const vsplat_render_options* options,
                                                                 const vsplat_picture* gradient,
                                                                 const vsplat_gaussians* arrays, double* out_pose);

/* Memory of drawing the scene from these cameras, one after the other, on a device on which nothing was drawn yet:
   projects and counts what overlaps, then stops. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_scene(vsplat_device device, vsplat_scene scene,
                                                            const vsplat_camera* cameras, size_t count,
                                                            const vsplat_render_options* options,
                                                            vsplat_plan* out_plan);

/* Memory of vsplat_render for `count` Gaussians of that degree into a picture of that size, guessed: each is taken to
   be seen and to touch eight tiles of 16 x 16 pixels, and these to lie evenly in the picture. What does not fit at once
   is drawn in parts, as vsplat_render does; where not even that fits, `peak` is what all of it at once would take. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_render(vsplat_device device, uint64_t count, int32_t sh_degree,
                                                             int32_t width, int32_t height, vsplat_plan* out_plan);

typedef enum vsplat_picture_format {
  VSPLAT_PICTURE_PNG = 1, /* 8-bit RGB, rounded, over the background it was drawn on */
  VSPLAT_PICTURE_EXR = 2, /* half R, G, B, A, linear and premultiplied: draw it over black; float Z = depth / alpha */
  VSPLAT_PICTURE_EXR_RAW = 3,  /* float R, G, B, A, Z as they are */
  VSPLAT_PICTURE_JPEG = 4,     /* as PNG, of quality 90 */
  VSPLAT_PICTURE_PNG_ALPHA = 5 /* 8-bit RGBA with straight alpha: draw it over black */
} vsplat_picture_format;

/* Writes what vsplat_render drew, whole or not at all. PNG and JPEG need `colour` alone, PNG_ALPHA `alpha` as
   well, EXR all three. An existing file is replaced. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save(const vsplat_picture* picture, int32_t width,
                                                              int32_t height, vsplat_picture_format format,
                                                              const char* path);
/* The bytes of that file, `*out_size` of them; the caller's, to be freed by vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save_memory(const vsplat_picture* picture, int32_t width,
                                                                     int32_t height, vsplat_picture_format format,
                                                                     char** out_bytes, size_t* out_size);
/* As JPEG of `quality` 1 to 100, with colours at full resolution. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save_jpeg(const vsplat_picture* picture, int32_t width,
                                                                   int32_t height, int32_t quality, const char* path);

#ifdef __cplusplus
}
#endif

#endif
