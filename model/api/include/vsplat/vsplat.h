/* vsplat: four posed photos in, a 3D Gaussian splat and novel views out, on any OpenCL device.

   How to read this header
   - Handles are opaque and counted: a call that makes one gives it to the caller with a count of one;
     vsplat_<noun>_retain adds one, vsplat_<noun>_release takes one away and frees at zero. Releasing NULL does nothing.
     A handle keeps alive whatever it was made from.
   - Every other call returns a status; results go through the trailing out_ pointers, which are written on success
   only. Bad input leaves every object as it was. vsplat_last_error() holds the sentence for a person, per thread.
   - Structs begin with their size: fill them from their _INIT macro, then set what you need. A library that is newer or
     older than the caller takes the fields that both know. In an array of structs the first one's size is the stride.
   Options that are NULL are all defaults, but where a call has no defaults for them and says so.
   - Cameras: OpenCV axes (x right, y down, z forward), pixels with centres at +0.5, matrices row-major, world to
   camera.
   - Pictures: [height][width][channels] float, colour sRGB-encoded in [0,1].
   - Text that a call hands out (char** out_text) is freed with vsplat_text_free.
   - Text that goes in is UTF-8, ended by NUL, and only read during the call.
   - Threads: different devices, and streams of one (vsplat_stream_create), may be used by different threads at the same
     time; calls that take the same one, or a handle made with it, one at a time: a call that finds the device taken ends
     at once with VSPLAT_ERROR_BUSY, and so does one from a callback of the call that has it. Not taken is it by
     vsplat_device_get_info, vsplat_opencl_get_handles, vsplat_stream_create, vsplat_device_cancel, and what retains and
     releases. Handles that belong to no
     device (model, views, cameras, scene) may be read by several threads. Calls block until their result is there, but
     for those that begin a job (vsplat/jobs.h); another thread may stop them (vsplat_device_cancel). Callbacks come on
     the calling thread, but for those of work that several devices share (vsplat/share.h).
   - Drivers do not live on in a child of fork(): there, calls that take a device end with VSPLAT_ERROR_DEVICE.
   - Within a major version this interface only grows. */
#ifndef VSPLAT_H
#define VSPLAT_H

#include <stddef.h>
#include <stdint.h>
#include <vsplat/export.h>
#include <vsplat/version.h>

#if defined(__GNUC__) || defined(__clang__)
#define VSPLAT_NODISCARD __attribute__((warn_unused_result))
#else
#define VSPLAT_NODISCARD
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* ------------------------------------------------------------------------------------------------- status and text */

typedef enum vsplat_status {
  VSPLAT_OK = 0,
  VSPLAT_ERROR_USAGE = 1,   /* the request itself is wrong: a null handle, an unknown field, a view that is not there */
  VSPLAT_ERROR_FILE = 2,    /* a file cannot be read or written, or exists already */
  VSPLAT_ERROR_FORMAT = 3,  /* a file's content is damaged or not what its format says */
  VSPLAT_ERROR_INPUT = 4,   /* well-formed input that cannot be used: a singular pose, a cube behind the cameras */
  VSPLAT_ERROR_DEVICE = 5,  /* no such device, no platform, a driver's error */
  VSPLAT_ERROR_COMPILE = 6, /* a kernel did not compile; the message holds the build log */
  VSPLAT_ERROR_MEMORY = 7,  /* more memory needed than there is; the message holds both figures */
  VSPLAT_ERROR_CANCELLED = 8, /* a progress function said stop, or vsplat_device_cancel */
  VSPLAT_ERROR_INTERNAL = 9,  /* a defect of the library */
  VSPLAT_ERROR_BUSY = 10      /* another call has the device: of another thread, or the one whose callback calls */
} vsplat_status;

/* "usage", "file", ...; "unknown" for other values. The text is static. */
VSPLAT_API const char* vsplat_status_name(vsplat_status status);

/* The sentence that belongs to the last call of this thread that failed; "" before the first failure. Valid until the
   next failure on this thread. */
VSPLAT_API const char* vsplat_last_error(void);

/* The library's VSPLAT_VERSION, and its "major.minor.patch". */
VSPLAT_API uint32_t vsplat_version(void);
VSPLAT_API const char* vsplat_version_string(void);

/* Frees what a call handed out; NULL is fine. */
VSPLAT_API void vsplat_text_free(char* text);

typedef enum vsplat_log_level {
  VSPLAT_LOG_WARNING = 1, /* worth a user's attention: frames without pictures, nothing selected */
  VSPLAT_LOG_INFO = 2,    /* what was found and chosen: the views, the cube */
  VSPLAT_LOG_VERBOSE = 3  /* details for whoever looks into something */
} vsplat_log_level;

/* `text` is one message without a line end, valid during the call. */
typedef void (*vsplat_log_function)(void* user, vsplat_log_level level, const char* text);

/* Where messages go, for the whole process; NULL, as at the start, silences them. The function may be called from any
   thread that uses the library, one at a time, and may not call the library. */
VSPLAT_API void vsplat_log_set(vsplat_log_function function, void* user);

/* What a program says about the files that the library writes and reads. Each is written under another name and put in
   place whole, or not at all. A file that another one names (the pictures and masks of a list of cameras, a mesh's
   materials, textures and buffers) is read where it lies, links followed, in the folder of the one that names it, in a
   folder that a call was given, or in the folder of pictures of a COLMAP model. */
typedef struct vsplat_file_rules {
  size_t size;
  int32_t (*may_replace)(void* user, const char* path); /* something is where a file is put: 0 keeps it, and the call
                                                           ends with VSPLAT_ERROR_FILE; NULL: it is replaced */
  void (*on_written)(void* user, const char* path, int32_t created); /* a file was put in place, `created` where
                                                                        nothing was; may be NULL */
  void* user;
  int32_t allow_outside; /* or anywhere: of files whose origin is trusted */
} vsplat_file_rules;
#define VSPLAT_FILE_RULES_INIT \
  { sizeof(vsplat_file_rules), NULL, NULL, NULL, 0 }

/* For the whole process; `rules` NULL: the defaults. The functions are called as vsplat_log_set's is. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_file_rules_set(const vsplat_file_rules* rules);

/* How much of the host's memory may be used, for the whole process: bytes; 0, as at the start: three quarters of what
   is free when that is first asked for, where control groups and `ulimit -v` leave less of that. Whoever reads a
   picture reserves what it will hold; beyond the limit the call ends with VSPLAT_ERROR_MEMORY and both figures. The
   buffers of a CPU device are in the same memory: they are reserved, too, and it plans with no more than this, unless
   vsplat_device_options.max_memory_gib says so. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_set_host_memory(uint64_t bytes);
/* Bytes that may be used, and that are reserved now; either may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_get_host_memory(uint64_t* out_limit, uint64_t* out_reserved);

/* Writes a file of the program's own as the library writes its. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_file_write(const char* path, const void* data, size_t bytes);

/* Called as a computation goes on: `stage` as in a profile ("encoder", "lifting", ...) and the share of all stages'
   work that is done, in [0,1]. Returns 0 to stop: the call then ends with VSPLAT_ERROR_CANCELLED. */
typedef int32_t (*vsplat_progress_function)(void* user, const char* stage, double done);

/* ------------------------------------------------------------------------------------------------------- devices */

typedef struct vsplat_device_impl* vsplat_device;

typedef enum vsplat_device_type {
  VSPLAT_DEVICE_CPU = 1,
  VSPLAT_DEVICE_GPU = 2,
  VSPLAT_DEVICE_ACCELERATOR = 3,
  VSPLAT_DEVICE_OTHER = 4
} vsplat_device_type;

/* Which family of dense kernels runs; both run on every device. */
typedef enum vsplat_kernels {
  VSPLAT_KERNELS_AUTO = 0, /* the environment's VSPLAT_KERNELS, else by the device's traits */
  VSPLAT_KERNELS_CPU = 1,  /* a work-item owns a register tile */
  VSPLAT_KERNELS_GPU = 2   /* a work-group tiles through local memory */
} vsplat_kernels;

/* Who multiplies plain matrices. */
typedef enum vsplat_gemm {
  VSPLAT_GEMM_AUTO = 0,   /* CLBlast on a GPU that its tuned database covers, else our own */
  VSPLAT_GEMM_OWN = 1,    /* the library's own kernels */
  VSPLAT_GEMM_CLBLAST = 2 /* CLBlast */
} vsplat_gemm;

typedef struct vsplat_device_info {
  size_t size;
  int32_t index;    /* flat, over all platforms */
  int32_t platform; /* position of its platform */
  int32_t device;   /* position within the platform */
  vsplat_device_type type;
  char name[256], vendor[256], driver[256], version[256], platform_name[256];
  uint64_t memory;       /* bytes */
  uint64_t max_alloc;    /* bytes of the largest single buffer */
  uint64_t local_memory; /* bytes per work-group */
  uint64_t max_work_group;
  int32_t compute_units;
  int32_t event_profiling; /* 1: device events carry times; 0: profiles are timed on the host */
  int32_t fp16, fp64, subgroups;
  vsplat_kernels kernels; /* of an open device: the flavour in use; AUTO in a list */
  int32_t has_uuid;       /* 1: the driver tells `uuid` (cl_khr_device_uuid), which Vulkan and CUDA know it by, too */
  uint8_t uuid[16];
  int32_t has_pci; /* 1: the driver tells where on the bus it is (cl_khr_pci_bus_info, or its vendor's own) */
  uint32_t pci_domain, pci_bus, pci_device, pci_function;
} vsplat_device_info;
#define VSPLAT_DEVICE_INFO_INIT                                                                              \
  {                                                                                                          \
    sizeof(vsplat_device_info), 0, 0, 0, VSPLAT_DEVICE_OTHER, "", "", "", "", "", 0, 0, 0, 0, 0, 0, 0, 0, 0, \
        VSPLAT_KERNELS_AUTO, 0, {0}, 0, 0, 0, 0, 0                                                           \
  }

/* How many OpenCL devices there are, over all platforms; 0 where there is no platform. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_count(size_t* out_count);
/* Describes device `index` < vsplat_device_count without opening it. Set out_info->size before. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_describe(size_t index, vsplat_device_info* out_info);

typedef struct vsplat_device_options {
  size_t size;
  /* Flat index ("0"), platform:device ("0:1"), type ("cpu", "gpu", "acc": the first of that type) or a part of the name
     of a device, its platform or its vendor, which no other may have. NULL or "": the environment's VSPLAT_DEVICE, else
     the first GPU, else the first device. Never falls back to another one. */
  const char* device;
  vsplat_kernels kernels;
  vsplat_gemm gemm;
  double max_memory_gib; /* the planner believes it; 0: what the device reports */
  /* Called before each kernel is compiled: its name and how many were compiled before it on this device. May be NULL.
   */
  void (*on_compile)(void* user, const char* kernel, int32_t compiled);
  void* user;
} vsplat_device_options;
#define VSPLAT_DEVICE_OPTIONS_INIT \
  { sizeof(vsplat_device_options), NULL, VSPLAT_KERNELS_AUTO, VSPLAT_GEMM_AUTO, 0.0, NULL, NULL }

/* Opens a device. `options` NULL: all defaults. VSPLAT_ERROR_DEVICE with a list where there is no such device. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_open(const vsplat_device_options* options,
                                                             vsplat_device* out_device);
/* A stream of an opened device: a device handle like any other, which every call takes that takes one. It computes
   beside that one, on another thread, with a queue and working memory of its own; compiled programs, models' weights
   and the limit of memory are the device's, whichever of its streams came first. Results are the same bits. May be
   called while the device is in use. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_stream_create(vsplat_device device, vsplat_device* out_stream);
VSPLAT_API void vsplat_device_retain(vsplat_device device);
VSPLAT_API void vsplat_device_release(vsplat_device device);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_get_info(vsplat_device device, vsplat_device_info* out_info);

/* Tells the call that has the device to stop, from any thread or signal handler; returns at once. That call ends with
   VSPLAT_ERROR_CANCELLED at its next launch of a kernel, when what was enqueued before is done, some 50 ms of work and
   one kernel: what it would have made is not made, what was there before is as it was. A training writes a checkpoint
   of its last whole step, a refinement goes on at its next step. Nothing happens where no call has the device. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_cancel(vsplat_device device);

/* Gives back device memory that is kept for the next call: the scene that was drawn last, the weights of models that no
   call uses, of all streams, and working memory of this one. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_trim(vsplat_device device);

typedef enum vsplat_profile_format {
  VSPLAT_PROFILE_JSON = 1,  /* {"device", "driver", "wall_s", "wall", "peak_bytes", "kernels": [...], ...} */
  VSPLAT_PROFILE_TRACE = 2, /* Chrome's and Perfetto's trace events */
  VSPLAT_PROFILE_TABLE = 3, /* for reading */
  VSPLAT_PROFILE_PAGE = 4   /* HTML that needs nothing else: timeline, roofline, tables */
} vsplat_profile_format;

/* Starts (on != 0) or stops recording every kernel's time, and what the host does meanwhile in calls of the library, in
   all threads of the process. Recording begins anew when it is started; the wall's time is what passes while it is on. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile(vsplat_device device, int32_t on);
/* What the host does is recorded from now on, and the next profile that is started in the process begins where this
   does: `seconds_ago` (0 to 1e9) before now. For the whole of a run, with what comes before a device is open. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_profile_begin(double seconds_ago);
/* Names what profiles of the device are of, in place of an earlier name: ("model", "small.safetensors"). Profiles show
   it as it is given; both are UTF-8 and copied. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_name(vsplat_device device, const char* what,
                                                                     const char* name);
/* What was recorded so far, the wall until this call. JSON and PAGE hold it against what the device can do at the most:
   that is measured once per device and driver, beside the recording's wall, in some tenths of a second, and kept in the
   cache. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_text(vsplat_device device, vsplat_profile_format format,
                                                                     char** out_text);

/* --------------------------------------------------------------------------------------------------------- models */

typedef struct vsplat_model_impl* vsplat_model;

typedef struct vsplat_model_options {
  size_t size;
  const char* config;        /* "paper", "small", "tiny" or "micro" */
  const char* const* fields; /* [num_fields] "FIELD=VALUE" changes to it; may be NULL */
  size_t num_fields;
  uint64_t seed;       /* of the random weights: the same file everywhere */
  const char* encoder; /* a file with DINO ViT weights (timm's names; safetensors, or of torch.save) for the encoder;
                          NULL: random, too */
  const char* system;  /* whose network: "vsplat", "lara", "genden" or "vsplat+genden"; LaRa's and GenDen's have
                          "published" for "paper"; NULL: "vsplat" */
} vsplat_model_options;
#define VSPLAT_MODEL_OPTIONS_INIT \
  { sizeof(vsplat_model_options), "paper", NULL, 0, 0, NULL, NULL }

/* Of the SHA-256 that a model file states of itself. A wrong one is VSPLAT_ERROR_FORMAT. */
typedef enum vsplat_hash_state {
  VSPLAT_HASH_ABSENT = 0,   /* the file states none (or the model comes from no file): damage to values goes unseen */
  VSPLAT_HASH_VERIFIED = 1, /* stated, and right */
  VSPLAT_HASH_STATED = 2    /* stated, not compared */
} vsplat_hash_state;

typedef struct vsplat_model_info {
  size_t size;
  int32_t image;          /* the network's pictures are image x image pixels */
  int32_t views;          /* how many views it is trained and measured with */
  int32_t max_views;      /* most that the network takes; at least one */
  int32_t volume;         /* voxels along an edge of the cube */
  int32_t sh_degree;      /* of the Gaussians it makes */
  uint64_t max_gaussians; /* that it can make, every voxel selected */
  uint64_t parameters;
  vsplat_hash_state hash;
  int32_t use_views; /* how many views vsplat_input_prepare picks by default, where there are more */
} vsplat_model_info;
#define VSPLAT_MODEL_INFO_INIT \
  { sizeof(vsplat_model_info), 0, 0, 0, 0, 0, 0, 0, VSPLAT_HASH_ABSENT, 0 }

typedef struct vsplat_import_options {
  size_t size;
  const char* config_file;   /* a JSON object with fields of the configuration; NULL: none */
  const char* const* fields; /* [num_fields] "FIELD=VALUE" changes to it; may be NULL */
  size_t num_fields;
} vsplat_import_options;
#define VSPLAT_IMPORT_OPTIONS_INIT \
  { sizeof(vsplat_import_options), NULL, NULL, 0 }

/* How a model file holds its values; the library computes with float32. */
typedef enum vsplat_dtype {
  VSPLAT_DTYPE_F32 = 1,
  VSPLAT_DTYPE_F16 = 2 /* half the size */
} vsplat_dtype;

/* A new model with random weights. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_init(const vsplat_model_options* options,
                                                            vsplat_model* out_model);
/* Reads a model file (safetensors): checks its structure, every expected tensor and, where it states one, its hash.
   `path` NULL: the model that the library carries; VSPLAT_ERROR_FILE where it was built without one. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load(const char* path, vsplat_model* out_model);
/* The same of a model file's bytes, which are only read during the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load_memory(const void* bytes, size_t size,
                                                                   vsplat_model* out_model);
/* A VS-Splat, LaRa or GenDen network of PyTorch's: a state dict in the published code's naming, with or without "net.",
   bare or in a checkpoint of Lightning's, as torch.save writes them since PyTorch 1.6. Nothing in the file is run: what
   is not a state dict's is refused by its name. What the tensors' shapes do not tell of the configuration is that of the
   named one which has all of them, else `options` says it, or the fields are named (VSPLAT_ERROR_USAGE).
   `negate_camera_centre` is true unless `options` says otherwise. `out_text`, which may be NULL, becomes a JSON
   object: "system" ("vsplat", "lara", "genden" or "vsplat+genden"), "config" (every field), "named" (the named
   configuration, or null) and "left_out", a list of what in the file is no part of the model. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_import(const char* path, const vsplat_import_options* options,
                                                              vsplat_model* out_model, char** out_text);
/* Writes a model file, whole or not at all; with its hash. An existing file is replaced. Values are float32. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save(vsplat_model model, const char* path);
/* The same with values of `dtype`. Of F16 each is rounded to the nearest, ties to even; VSPLAT_ERROR_INPUT where one is
   beyond its range (65504). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save_as(vsplat_model model, const char* path,
                                                               vsplat_dtype dtype);
/* The same model with another number of views that vsplat_input_prepare picks by default (vsplat_model_info.use_views),
   1 to max_views: for its makers, who have measured what is best. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_with_use_views(vsplat_model model, int32_t use_views,
                                                                      vsplat_model* out_model);
VSPLAT_API void vsplat_model_retain(vsplat_model model);
VSPLAT_API void vsplat_model_release(vsplat_model model);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_get_info(vsplat_model model, vsplat_model_info* out_info);
/* What a model file's header says, without reading its values (hash: ABSENT or STATED), and the same as a JSON object:
   "config" (every field), "tensors", "parameters", "file_bytes", "dtypes", "sha256" and "provenance". Either out_
   pointer may be NULL. `path` NULL: as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_inspect(const char* path, vsplat_model_info* out_info,
                                                               char** out_text);
/* Reads all of a model file and keeps nothing: structure, shapes, and the hash where one is stated. `path` NULL:
   as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_verify(const char* path, vsplat_hash_state* out_state);

/* -------------------------------------------------------------------------------------------------------- cameras */

/* How a lens bends rays, from undistorted normalised (x, y) to distorted, as COLMAP, OpenCV and nerfstudio have it. */
typedef enum vsplat_lens {
  VSPLAT_LENS_PINHOLE = 0,
  VSPLAT_LENS_OPENCV = 1, /* k1 k2 p1 p2 k3 k4 k5 k6: COLMAP's SIMPLE_RADIAL to FULL_OPENCV, with zeros */
  VSPLAT_LENS_FISHEYE = 2 /* k1 k2 k3 k4: theta (1 + k1 theta^2 + k2 theta^4 + ...) */
} vsplat_lens;

/* Stands in other structs: it does not grow. */
typedef struct vsplat_camera {
  size_t size;
  int32_t width, height; /* pixels */
  double fx, fy, cx, cy; /* pixels */
  double w2c[16];        /* row-major [4][4], a rigid motion: world to camera */
  vsplat_lens lens;      /* of a photograph, which is undistorted when it is taken; what is drawn has none */
  double lens_values[8]; /* in the order above; zeros behind the last */
} vsplat_camera;
#define VSPLAT_CAMERA_INIT                                                                             \
  {                                                                                                    \
    sizeof(vsplat_camera), 0, 0, 0.0, 0.0, 0.0, 0.0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, \
        VSPLAT_LENS_PINHOLE, {                                                                         \
      0, 0, 0, 0, 0, 0, 0, 0                                                                           \
    }                                                                                                  \
  }

typedef struct vsplat_cameras_impl* vsplat_cameras;

/* Every camera of a transforms.json, a cameras.json or a COLMAP model, or of the folder that holds one; as pinholes,
   pictures not needed. `width` and `height`: the size for cameras whose file tells none; 0: such are an error. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_load(const char* path, int32_t width, int32_t height,
                                                              vsplat_cameras* out_cameras);
VSPLAT_API void vsplat_cameras_retain(vsplat_cameras cameras);
VSPLAT_API void vsplat_cameras_release(vsplat_cameras cameras);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_count(vsplat_cameras cameras, size_t* out_count);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_get(vsplat_cameras cameras, size_t index,
                                                             vsplat_camera* out_camera);
/* `count` (1 to 10000) cameras on a smooth path through `keys`, in their order: centres on a cubic spline through the
   keys' centres, rotations by the shorter arcs, fields of view and principal points interpolated, pictures in the first
   key's size. The first and the last camera are the first and the last key; all are the first key where there is one
   key or one camera. Where all keys see a point that their optical axes meet at or pass by, as cameras about an object
   do, the path goes round it and keeps it in the picture. VSPLAT_ERROR_INPUT where a key's pictures have other proportions than the first one's. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_path(vsplat_cameras keys, int32_t count,
                                                              vsplat_cameras* out_cameras);

/* Writes cameras as a cameras.json that vsplat_cameras_load and vsplat_views_load read back, the same to the bit; whole
   or not at all, an existing file is replaced. `files`: [count] the pictures' paths relative to the file's folder; NULL:
   0000.png, 0001.png, ... */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_cameras_save(const vsplat_camera* cameras, size_t count,
                                                              const char* const* files, const char* path);

/* ---------------------------------------------------------------------------------------------------------- views */

/* Posed photographs as they were taken, before any choice: read lazily from files, or held in memory. */
typedef struct vsplat_views_impl* vsplat_views;

/* How a picture in memory holds its values; in the machine's byte order. */
typedef enum vsplat_pixel_type {
  VSPLAT_PIXELS_F32 = 0, /* 0 to 1 */
  VSPLAT_PIXELS_F16 = 1, /* IEEE half precision, 0 to 1 */
  VSPLAT_PIXELS_U8 = 2   /* 0 to 255 */
} vsplat_pixel_type;

typedef struct vsplat_view {
  size_t size;
  vsplat_camera camera;   /* of the whole picture */
  const float* pixels;    /* [height][width][channels], 0 to 1; copied. NULL where `data` holds them */
  int32_t channels;       /* 3: RGB; 4: RGBA, composited to white */
  vsplat_pixel_type type; /* of `data` */
  const void* data;       /* [height] rows of [width][channels] values; copied. NULL where `pixels` holds them */
  size_t row_bytes;       /* from a row of `data` to the next; 0: they lie without gaps */
  int32_t premultiplied;  /* 1: colour has been multiplied by alpha; 0: alpha is straight */
} vsplat_view;
#define VSPLAT_VIEW_INIT \
  { sizeof(vsplat_view), VSPLAT_CAMERA_INIT, NULL, 3, VSPLAT_PIXELS_F32, NULL, 0, 0 }

/* Reads the list of views at `path`: a transforms.json, a cameras.json, a COLMAP model or a folder holding one.
   `pictures`: where a COLMAP model's pictures are, or NULL to look beside it. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_load(const char* path, const char* pictures,
                                                            vsplat_views* out_views);
/* From pictures in memory. Pixels up to 0.5 beyond 0 to 1, as resampling leaves them, are clamped; what lies further
   beyond and NaN are VSPLAT_ERROR_INPUT, naming view, pixel and value. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_create(const vsplat_view* views, size_t num_views,
                                                              vsplat_views* out_views);
VSPLAT_API void vsplat_views_retain(vsplat_views views);
VSPLAT_API void vsplat_views_release(vsplat_views views);
/* How many are listed, with or without a picture. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_count(vsplat_views views, size_t* out_count);
/* Bytes of the host's memory that reading all of their pictures takes at most; reads the files' headers. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_memory(vsplat_views views, uint64_t* out_bytes);
/* What view `index` is listed as: its picture's path, or the place of one in memory. To be freed by vsplat_text_free.
 */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_name(vsplat_views views, size_t index, char** out_text);
/* The files they are read from, a line each: the list, its pictures and masks that are there. None of pictures in
   memory. To be freed by vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_views_get_files(vsplat_views views, char** out_text);

/* ---------------------------------------------------------------------------------------------------------- input */

/* The chosen views as the network sees them: cropped, resampled, undistorted, on white, with the object's cube placed.
 */
typedef struct vsplat_input_impl* vsplat_input;

typedef enum vsplat_fit {
  VSPLAT_FIT_AUTO = 0,   /* resamples square pictures, treats others as OBJECT */
  VSPLAT_FIT_OBJECT = 1, /* the square about the cube's projected centre that spans 1.5 of its edges */
  VSPLAT_FIT_CROP = 2,   /* the centre square */
  VSPLAT_FIT_PAD = 3     /* the whole picture, white beside it */
} vsplat_fit;

typedef struct vsplat_input_options {
  size_t size;
  const char* const* names; /* [num_names] views by name (stem or path) or "@index", the first being the reference view;
                               NULL: `view_count` of them by k-means over the cameras, or all */
  size_t num_names;
  int32_t has_center; /* 1: `center` is set */
  double center[3];   /* of the object's cube, in the world */
  double scale;       /* the cube's edge in world units; 0: not set */
  int32_t
      auto_frame; /* 1: what is not set is estimated from cameras and masks; 0: it comes from the file, else 0,0,0, 1 */
  vsplat_fit fit;
  int32_t force;      /* 1: goes on where the cube seems to be behind or outside most views */
  int32_t view_count; /* how many views are picked where there are more and `names` is NULL, 1 to the model's max_views;
                         0: the model's use_views */
} vsplat_input_options;
#define VSPLAT_INPUT_OPTIONS_INIT \
  { sizeof(vsplat_input_options), NULL, 0, 0, {0, 0, 0}, 0.0, 0, VSPLAT_FIT_AUTO, 0, 0 }

typedef struct vsplat_input_info {
  size_t size;
  int32_t views;
  int32_t image;    /* pixels along an edge */
  double center[3]; /* the cube, as it was placed */
  double scale;
  double up[3]; /* which way is up in the world, of length 1, from all listed cameras: across their horizontal axes, or
                   the world's axis next to that where the cameras are rolled too much to tell them apart */
} vsplat_input_info;
#define VSPLAT_INPUT_INFO_INIT                                   \
  {                                                              \
    sizeof(vsplat_input_info), 0, 0, {0, 0, 0}, 0.0, { 0, 0, 0 } \
  }

/* Chooses views, places the cube, checks both and prepares the pictures for `model`. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_prepare(vsplat_model model, vsplat_views views,
                                                               const vsplat_input_options* options,
                                                               vsplat_input* out_input);
VSPLAT_API void vsplat_input_retain(vsplat_input input);
VSPLAT_API void vsplat_input_release(vsplat_input input);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_info(vsplat_input input, vsplat_input_info* out_info);
/* The camera of view `index`, in the user's world, as the picture was cropped and resampled. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_camera(vsplat_input input, size_t index,
                                                                  vsplat_camera* out_camera);
/* The picture of view `index`: float [image][image][3] into the caller's memory of `capacity` floats. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_picture(vsplat_input input, size_t index, float* out_pixels,
                                                                   size_t capacity);
/* The files that vsplat_input_save would write into `folder`, a line each. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_get_files(vsplat_input input, const char* folder,
                                                                 char** out_text);
/* Writes the pictures as 8-bit PNG files and their cameras.json into `folder`, which is made where it is not there: a
   folder that reads like any other. Existing files are replaced. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_input_save(vsplat_input input, const char* folder);

/* ---------------------------------------------------------------------------------------------------------- scene */

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
} vsplat_scene_info;
#define VSPLAT_SCENE_INFO_INIT \
  { sizeof(vsplat_scene_info), 0, 0, 0.0, 0, {0, 0, 0}, 0, 0, 0, {0, 0, 0}, {0, 0, 0}, 0 }

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
   length), offset and surfels are taken.
   Of `arrays`, none may be NULL: rotations of any length but 0, scales not negative, opacities in [0,1], every value
   finite; VSPLAT_ERROR_INPUT names the first that is not. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_create(const vsplat_scene_info* info,
                                                              const vsplat_gaussians* arrays, vsplat_scene* out_scene);
/* New values for the same Gaussians, checked and copied in the same way; arrays that are NULL stay as they were.
   Nothing else may use the scene meanwhile. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_update(vsplat_scene scene, const vsplat_gaussians* arrays);
/* Writes one, whole or not at all. An existing file is replaced. Where the scene has an offset, positions in the file
   are relative to it, and the file says so in a comment that vsplat_scene_load obeys and other programs do not. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_save(vsplat_scene scene, const char* path);
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

/* ---------------------------------------------------------------------------------------------------- reconstruct */

/* The share of the voxels, of LaRa's and GenDen's networks that of the primitives, that a reconstruction takes for
   selected where nothing else is said. */
#define VSPLAT_ASSUME_SELECTED 0.1

typedef struct vsplat_reconstruct_options {
  size_t size;
  const int32_t* voxels; /* [num_voxels] a list, ascending, that replaces the network's selection; NULL: none */
  size_t num_voxels;
  const char* selection; /* the same from a file; NULL: none */
  int32_t has_seed; /* 1: the selection is drawn with noise from `seed`; of GenDen's network: the order of curves */
  uint64_t seed;
  double near_plane; /* of the scene, world units; 0: 0.2 times the cube's edge */
  const char* dump;  /* a folder: every stage in its stages.safetensors; NULL: none */
  /* Share of the voxels for which a run that does not fit is refused beforehand; 0: VSPLAT_ASSUME_SELECTED. */
  double assume_selected;
  vsplat_progress_function progress; /* may be NULL */
  void* user;
  double up[3]; /* which way is up in the world, for the scene to tell; 0, 0, 0: the input's (vsplat_input_info) */
} vsplat_reconstruct_options;
#define VSPLAT_RECONSTRUCT_OPTIONS_INIT                                                              \
  {                                                                                                  \
    sizeof(vsplat_reconstruct_options), NULL, 0, NULL, 0, 0, 0.0, NULL, 0.0, NULL, NULL, { 0, 0, 0 } \
  }

/* One forward pass. The scene is in the frame of the input's cameras. With no voxel selected it is empty: not an error.
   The model's weights stay on the device until model or device go. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_reconstruct(vsplat_device device, vsplat_model model,
                                                             vsplat_input input,
                                                             const vsplat_reconstruct_options* options,
                                                             vsplat_scene* out_scene);

typedef struct vsplat_prepare_options {
  size_t size;
  int32_t views; /* that a reconstruction will have; 0: as many as the model is trained with */
  int32_t
      launch; /* not 0: reconstructs grey pictures and draws what comes of it, too: for drivers that compile a kernel
                     where it is first launched. Takes the time of a reconstruction beside that */
  vsplat_progress_function progress; /* stages "weights", "compile" and "launch"; may be NULL */
  void* user;
} vsplat_prepare_options;
#define VSPLAT_PREPARE_OPTIONS_INIT \
  { sizeof(vsplat_prepare_options), 0, 0, NULL, NULL }

/* Does ahead what the first reconstruction with the model and its drawing would do once: puts the weights on the device
   and compiles every program that they take. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_prepare(vsplat_device device, vsplat_model model,
                                                                const vsplat_prepare_options* options);

typedef enum vsplat_program_jobs {
  VSPLAT_PROGRAMS_OF_RECONSTRUCT = 1,
  VSPLAT_PROGRAMS_OF_RENDER = 2, /* volumes and surfels, and the gradients of drawing them */
  VSPLAT_PROGRAMS_OF_REFINE = 4,
  VSPLAT_PROGRAMS_OF_TRAIN = 8
} vsplat_program_jobs;

typedef struct vsplat_programs_options {
  size_t size;
  uint32_t jobs;                     /* the sum of values of vsplat_program_jobs */
  int32_t others;                    /* not 0: kernels of the device's flavour that none of the jobs launches, too */
  int32_t sources;                   /* not 0: with each program's text */
  int32_t build;                     /* not 0: compiles each program for the device, to tell local memory */
  vsplat_progress_function progress; /* stage "programs"; may be NULL */
  void* user;
} vsplat_programs_options;
#define VSPLAT_PROGRAMS_OPTIONS_INIT \
  { sizeof(vsplat_programs_options), 15, 1, 0, 0, NULL, NULL }

/* The OpenCL programs of jobs with that model on that device, found by planning them; nothing is launched, and without
   `build` nothing compiled. The model may be NULL where jobs are neither to reconstruct nor to train. `options` NULL:
   defaults, all jobs and all other kernels. `out_text` becomes JSON, to be freed with vsplat_text_free: {"device",
   "driver", "flavour", "allowed", "programs": [{"name", "options", "targets", "text", "kernels": [{"name", "launches":
   [{"job", "stage", "group", "local_bytes"}], "local_memory", "error"}]}]}. `allowed` is what cl/allowed.txt says;
   `targets` stands where only these vendors' compilers can read the program; `text` has includes expanded; `group` is
   the work-group's size, null where the driver chooses; `local_bytes` the local memory that is an argument of the
   launch; `local_memory` that which the kernel declares, both in bytes, or null, with `error` saying why the device's
   compiler does not take it. Kernels that nothing launches have no launches. Models of other sizes and other
   devices may have programs built with other options. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_programs(vsplat_device device, vsplat_model model,
                                                                 const vsplat_programs_options* options,
                                                                 char** out_text);

/* What a computation will need. */
typedef struct vsplat_stage_memory {
  char stage[32];
  uint64_t reserved; /* bytes of device memory that are held when the stage needs most */
  uint64_t live;     /* bytes of them in use */
} vsplat_stage_memory;

#define VSPLAT_MAX_STAGES 32
typedef struct vsplat_plan {
  size_t size;
  uint64_t peak;  /* bytes */
  uint64_t limit; /* bytes that may be used */
  int32_t fits;   /* 1: peak <= limit, and no buffer exceeds the device's largest */
  uint32_t num_stages;
  vsplat_stage_memory stages[VSPLAT_MAX_STAGES];
  uint64_t host_peak;  /* bytes of the host's memory beside them: results, pictures; 0: little */
  uint64_t host_limit; /* of vsplat_set_host_memory. `fits` looks at it, too; where the device is a CPU, at the sum */
} vsplat_plan;
#define VSPLAT_PLAN_INIT \
  { sizeof(vsplat_plan), 0, 0, 0, 0, {{"", 0, 0}}, 0, 0 }

/* Memory of vsplat_reconstruct for `views` views with that share of the voxels selected (1: the hard bound), without
   computing anything. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_reconstruct(vsplat_device device, vsplat_model model,
                                                                  int32_t views, double selected,
                                                                  vsplat_plan* out_plan);

/* --------------------------------------------------------------------------------------------------------- render */

typedef struct vsplat_orbit_options {
  size_t size;
  int32_t count;         /* cameras on the circle */
  int32_t width, height; /* pixels; 0: 512 x 512 */
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
  int32_t exact_tiles; /* 1: tiles that a Gaussian's ellipse does not reach are not sorted for it. The same picture to
                          the bit; less work where many Gaussians are long, thin and slanted, a little more elsewhere */
} vsplat_render_options;
#define VSPLAT_RENDER_OPTIONS_INIT \
  { sizeof(vsplat_render_options), {1, 1, 1}, 0.0, NULL, NULL, 0 }

/* Arrays of the caller, any of them NULL where not wanted. */
typedef struct vsplat_picture {
  size_t size;
  uint64_t capacity; /* pixels that fit into every array */
  float* colour;     /* [height][width][3] over the background; may exceed 1 */
  float* alpha;      /* [height][width] */
  float* depth;      /* [height][width] accumulated: sum of weight x camera z, world units */
} vsplat_picture;
#define VSPLAT_PICTURE_INIT \
  { sizeof(vsplat_picture), 0, NULL, NULL, NULL }

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
   opacities, not by a logarithm or a logit; NULL, or arrays of it that are NULL, where not wanted. `out_pose`, where it
   is not NULL, takes six: by (omega, tau) at 0, where the camera's pose is exp([omega, tau]) times w2c: a turn about
   the camera's axes, in radians, and a shift along them, in world units. They are the true derivatives, with the order
   of the Gaussians and what is left out of the picture held as they are: alpha does not change where it is limited to
   0.99, nor colour where it is limited to 0. The same bits every time. The picture is drawn once more to begin with.
   What is written replaces what was there; sums over cameras are the caller's. */
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
/* As JPEG of `quality` 1 to 100, with colours at full resolution. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_picture_save_jpeg(const vsplat_picture* picture, int32_t width,
                                                                   int32_t height, int32_t quality, const char* path);

/* ------------------------------------------------------------------------------------------------------ data sets */

/* Objects with posed pictures, of one or more of these: a folder for each object that vsplat_views_load takes (masks,
   alpha, aabb_center and aabb_half as there), or LaRa's layout of Google Scanned Objects (transforms.json with
   intrinsic_matrix, r_000.png, ...), in folders at most four levels down; HDF5 files in LaRa's layout (a group for each
   object with image_I [H][W][4] of 8 bits, c2w_I [4][4], OpenCV axes, and fov_I [2] in radians). Belongs to no device;
   may be read by several threads. */
typedef struct vsplat_dataset_impl* vsplat_dataset;

#ifdef __cplusplus
}
#endif

#include <vsplat/dataset.h>
#include <vsplat/evaluate.h>
#include <vsplat/jobs.h>
#include <vsplat/pictures.h>
#include <vsplat/ranks.h>
#include <vsplat/refine.h>
#include <vsplat/share.h>
#include <vsplat/train.h>

#endif
