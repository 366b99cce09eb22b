/* Drawing a scene: pictures, their gradients, cameras on a circle, picture files. Part of vsplat.h, which states the
   common conventions. */
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
  int32_t width, height; /* pixels; 0: 512 */
  double radius;         /* world units; 0: from the inputs or the scene */
  int32_t has_elevation; /* 1: `elevation` is set */
  double elevation;      /* degrees above the plane perpendicular to `up` */
  int32_t has_up;        /* 1: `up` is set */
  double up[3];
} vsplat_orbit_options;
#define VSPLAT_ORBIT_OPTIONS_INIT                                      \
  {                                                                    \
    sizeof(vsplat_orbit_options), 8, 0, 0, 0.0, 0, 0.0, 0, { 0, 0, 0 } \
  }

/* Cameras on a circle about the cube's centre, at the input views' median distance and elevation, around the input's up
   axis. The field of view is their median, or wider if needed to show the cylinder inscribed in the cube with a
   margin. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_orbit_input(vsplat_input input,
                                                                     const vsplat_orbit_options* options,
                                                                     vsplat_cameras* out_cameras);
/* Cameras on a level circle about the middle of the visible part of the scene, with a field of view of 50 degrees, at
   the distance that leaves a margin of a twentieth of the picture on every side. Distant Gaussians (floaters) are
   ignored. Up is the scene's, or -y if the scene has none. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_orbit_scene(vsplat_scene scene,
                                                                     const vsplat_orbit_options* options,
                                                                     vsplat_cameras* out_cameras);

/* Anti-aliasing. A Gaussian's covariance S in the picture, in pixels^2, is drawn as S + 0.3 I, so that it covers at
   least about a pixel. With anti-aliasing its opacity is multiplied by sqrt(det S / det(S + 0.3 I)): what is smaller than
   a pixel becomes fainter instead of larger (Mip-Splatting). Scenes that were not fitted so look too thin with it. */
typedef enum vsplat_antialias {
  VSPLAT_ANTIALIAS_SCENE = 0, /* as vsplat_scene_info.antialias says */
  VSPLAT_ANTIALIAS_ON = 1,    /* VSPLAT_ERROR_USAGE: the scene has surfels */
  VSPLAT_ANTIALIAS_OFF = 2
} vsplat_antialias;

typedef struct vsplat_render_options {
  size_t size;
  float background[3]; /* sRGB-encoded */
  double near_plane;   /* world units; 0: the scene's */
  vsplat_progress_function progress;
  void* user;
  int32_t exact_tiles;  /* 1: does not sort a Gaussian into tiles that its ellipse does not reach. The picture is equal
                           to the bit. Less work if many Gaussians are long, thin and slanted, a little more
                           otherwise */
  uint64_t supersample; /* samples along a pixel's edge, 1 to 8: the picture is drawn at so many times its width and
                           height, and averaged. 0: if the scene knows the resolution of the pictures that it was made
                           from, and a pixel is at least twice as wide as theirs, as many samples as stay no finer than
                           those pictures and within 2048 pixels drawn; else 1. Gradients accept only 0 and 1, both one
                           sample */
  vsplat_antialias antialias;
} vsplat_render_options;
#define VSPLAT_RENDER_OPTIONS_INIT \
  { sizeof(vsplat_render_options), {1, 1, 1}, 0.0, NULL, NULL, 0, 0, VSPLAT_ANTIALIAS_SCENE }

/* The caller's arrays; NULL for a plane that is not wanted. A call that draws needs at least one. VSPLAT_ERROR_USAGE:
   two arrays of one picture share memory. */
typedef struct vsplat_picture {
  size_t size;
  uint64_t capacity; /* pixels that fit into every array */
  float* colour;     /* [height][width][3] over the background; may exceed 1 */
  float* alpha;      /* [height][width] */
  float* depth;      /* [height][width] accumulated depth: sum of weight x camera z, world units */
  /* The picture of vsplat_render, vsplat_render_views and vsplat_render_async once more, in a program's pixel format;
     other functions ignore this and the following fields. [height] rows of [width][channels] values; NULL: not
     wanted */
  void* data;
  vsplat_pixel_type type; /* of `data`; 8-bit values are rounded as in PNG files, and clamped to 0 to 1 */
  int32_t channels;       /* 3: RGB over the background; 4: RGBA, without the background */
  size_t row_bytes;       /* bytes from a row of `data` to the next; 0: rows without padding */
  int32_t premultiplied;  /* 1: colour is multiplied by alpha; 0: alpha is straight */
  size_t data_bytes;      /* size of `data` in bytes: VSPLAT_ERROR_USAGE if its rows need more. 0: unknown; then
                             `capacity` applies to `data` too */
  /* Where surfaces are, with one sample a pixel regardless of supersampling. For volumes the host computes `median` and
     `ids`, and draws `normal` from a copy of the scene: these are slower than the rest. */
  float* expected; /* [height][width] depth / alpha, the mean depth; 0 where alpha is 0 */
  float* median;   /* [height][width] camera z of the last Gaussian reached with a transmittance above 0.5; 0 if none
                      was */
  float* normal; /* [height][width][3] sum of weight x normal, in camera axes, facing the camera; a Gaussian's normal is
                    its shortest axis */
  int32_t* ids;  /* [height][width] index into the scene of the nearest Gaussian with an alpha of 1/255 or more; -1:
                    none. Only for volumes: VSPLAT_ERROR_USAGE for surfels */
} vsplat_picture;
#define VSPLAT_PICTURE_INIT \
  { sizeof(vsplat_picture), 0, NULL, NULL, NULL, NULL, VSPLAT_PIXELS_F32, 3, 0, 0, 0, NULL, NULL, NULL, NULL }

/* Draws the scene from a camera, as the original 3D Gaussian splatting rasteriser defines it. `options` NULL: defaults.
   The scene's Gaussians stay on the device until the scene or the device is freed. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render(vsplat_device device, vsplat_scene scene,
                                                        const vsplat_camera* camera,
                                                        const vsplat_render_options* options,
                                                        const vsplat_picture* picture);

/* Like vsplat_render for `count` cameras and as many pictures, which may differ in size. A request with an error in any
   of them is refused before the first is drawn. Progress is reported before each picture. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_views(vsplat_device device, vsplat_scene scene,
                                                              const vsplat_camera* cameras, size_t count,
                                                              const vsplat_render_options* options,
                                                              const vsplat_picture* pictures);

/* Derivatives of a loss on the picture that vsplat_render draws. `gradient` holds the loss's derivatives by the
   picture's values, shaped as vsplat_render writes them; arrays that are NULL count as zeros. `arrays` receives the
   derivatives by the scene's Gaussians, shaped as vsplat_scene_get_gaussians writes them: by the scales themselves, by
   the rotations as they are, of any length, and by the opacities, not by a logarithm or a logit; NULL, or arrays of it
   that are NULL, if not wanted; at least one array or `out_pose` is needed. `out_pose`, if it is not NULL, receives
   six: the se(3) gradient by (omega, tau) at 0, where the camera's pose is exp([omega, tau]) times w2c: a rotation
   about the camera's axes, in radians, and a translation along them, in world units. The result is equal to the bit
   every time. The picture is drawn again first, with one sample a pixel. Results are overwritten; the caller sums over
   cameras.

   They are the derivatives of the picture as it is drawn, with its choices held as they are:
   - which Gaussians a pixel shows, and in which order: one whose alpha there is under 1/255 shows nothing, and its
     derivatives by that pixel are 0, however near to 1/255 it is;
   - where a pixel's ray ends: before the Gaussian that would bring its transmittance under 1e-4;
   - limits: alpha does not change where it is limited to 0.99, nor a colour where it is limited to 0;
   - which Gaussians are left out altogether: those in front of the near plane.
   At these places, and at the edges of the tiles in which a Gaussian is drawn, the picture itself jumps, by up to 1/100
   of the Gaussian's colour. A difference of two pictures includes these jumps; the derivatives do not. The edge where
   alpha is 1/255 moves over pixels when mean, scale, rotation or opacity change. Measured with single Gaussians with
   standard deviations of 5 and of 12 pixels, differences by mean, scale and rotation exceed the derivatives by 2 % at an
   opacity of 0.9, by 5 % at 0.3 and by 14 % at 0.1; differences by opacity exceed them by 0.5 %, 1 % and 4 %;
   differences by colours agree. These are averages, equal for steps from 3e-2 to 1e-4. Single differences with a small
   step scatter: most cross no jump and agree; a few are off by their own size or more.

   A test by finite differences can check derivatives by colours in every scene. It can check all others in a scene
   without jumps: every Gaussian covers the whole picture with an alpha well above 1/255 and below 0.99, and no pixel's
   ray ends early. There, central differences with a step of 1e-2 agree to 0.1 % (scales of 1.5, a picture of 96 x 96
   pixels); with steps below 1e-3 the rounding of floats shows. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_render_backward(vsplat_device device, vsplat_scene scene,
                                                                 const vsplat_camera* camera,
                                                                 const vsplat_render_options* options,
                                                                 const vsplat_picture* gradient,
                                                                 const vsplat_gaussians* arrays, double* out_pose);

/* Plans the memory of drawing the scene from these cameras, one after the other, on a device on which nothing was drawn
   yet: projects the Gaussians and counts their overlaps with tiles, then stops. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_scene(vsplat_device device, vsplat_scene scene,
                                                            const vsplat_camera* cameras, size_t count,
                                                            const vsplat_render_options* options,
                                                            vsplat_plan* out_plan);

/* Estimates the memory of vsplat_render for `count` Gaussians of that degree in a picture of that size. Assumes that
   each Gaussian is visible and touches eight tiles of 16 x 16 pixels, spread evenly over the picture. A picture that
   does not fit at once is drawn in tiles, as vsplat_render does. If not even that fits, `peak` is the memory for the
   whole picture at once. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_render(vsplat_device device, uint64_t count, int32_t sh_degree,
                                                             int32_t width, int32_t height, vsplat_plan* out_plan);

typedef enum vsplat_picture_format {
  VSPLAT_PICTURE_PNG = 1,       /* 8-bit RGB, rounded, over the background it was drawn on */
  VSPLAT_PICTURE_EXR = 2,       /* half-float R, G, B, A, linear and premultiplied (draw over black); float Z = depth /
                                  alpha */
  VSPLAT_PICTURE_EXR_RAW = 3,   /* float R, G, B, A, Z, unconverted */
  VSPLAT_PICTURE_JPEG = 4,      /* like PNG, with quality 90 */
  VSPLAT_PICTURE_PNG_ALPHA = 5, /* 8-bit RGBA with straight alpha (draw over black) */
  VSPLAT_PICTURE_PNG_EXPECTED = 6, /* `expected` as 16-bit grey, thousandths of a world unit, at most 65535; 0: none */
  VSPLAT_PICTURE_PNG_MEDIAN = 7,   /* `median` likewise */
  VSPLAT_PICTURE_PNG_NORMAL = 8    /* the direction of `normal` as 8-bit RGB, 0 to 255 for -1 to 1: red to the right,
                                      green up, blue towards the camera; black: none */
} vsplat_picture_format;

/* Writes what vsplat_render drew to a file, whole or not at all; replaces an existing file. PNG and JPEG need `colour`
   alone, PNG_ALPHA also `alpha`, EXR all three. EXR also gets those of `expected`, `median` and `normal` that are not
   NULL, as float layers: expected.Z, median.Z, normal.X, normal.Y and normal.Z. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save(const vsplat_picture* picture, int32_t width,
                                                              int32_t height, vsplat_picture_format format,
                                                              const char* path);
/* The bytes of that file, `*out_size` of them. They belong to the caller; free them with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save_memory(const vsplat_picture* picture, int32_t width,
                                                                     int32_t height, vsplat_picture_format format,
                                                                     char** out_bytes, size_t* out_size);
/* Writes a JPEG of `quality` 1 to 100, with colours at full resolution. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save_jpeg(const vsplat_picture* picture, int32_t width,
                                                                   int32_t height, int32_t quality, const char* path);

#ifdef __cplusplus
}
#endif

#endif
