/* OpenCL devices: listing and opening them, their streams, their profiles. Part of vsplat.h, which states the common
   conventions. */
#ifndef VSPLAT_DEVICE_H
#define VSPLAT_DEVICE_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_device_impl* vsplat_device;

typedef enum vsplat_device_type {
  VSPLAT_DEVICE_CPU = 1,
  VSPLAT_DEVICE_GPU = 2,
  VSPLAT_DEVICE_ACCELERATOR = 3,
  VSPLAT_DEVICE_OTHER = 4
} vsplat_device_type;

/* Which family of dense kernels runs. Both run on every device. */
typedef enum vsplat_kernels {
  VSPLAT_KERNELS_AUTO = 0, /* VSPLAT_KERNELS of the environment, else by the device's traits */
  VSPLAT_KERNELS_CPU = 1,  /* each work-item computes a register tile */
  VSPLAT_KERNELS_GPU = 2   /* each work-group computes a tile through local memory */
} vsplat_kernels;

/* Which code multiplies plain matrices. */
typedef enum vsplat_gemm {
  VSPLAT_GEMM_AUTO = 0,   /* the library's own kernels */
  VSPLAT_GEMM_OWN = 1,    /* the library's own kernels */
  VSPLAT_GEMM_CLBLAST = 2 /* CLBlast */
} vsplat_gemm;

/* Number format of the network's large matrix products when it computes a scene. Rendering, fitting and the measures of
   pictures use fp32 with any value. Training keeps weights, gradients, moments and losses in fp32. */
typedef enum vsplat_precision {
  VSPLAT_PRECISION_FP32 = 0,  /* fp32 throughout */
  VSPLAT_PRECISION_MIXED = 1, /* operands rounded to bf16, sums in fp32; computed by the device's matrix units if these
                                 have passed a test on it, else emulated, which is slower than fp32; with the gpu
                                 kernels, or the cpu kernels on a processor with avx512_bf16 */
  VSPLAT_PRECISION_AUTO = 2   /* as an option only: MIXED if the device has matrix units, passed its last self-test
                                 (vsplat_selftest), and lost less than 0.02 dB of the built-in object's PSNR by it, which
                                 a self-test that is not quick measures; else FP32 */
} vsplat_precision;

typedef struct vsplat_device_info {
  size_t size;
  int32_t index;    /* flat index over all platforms */
  int32_t platform; /* index of its platform */
  int32_t device;   /* index within the platform */
  vsplat_device_type type;
  char name[256], vendor[256], driver[256], version[256], platform_name[256];
  uint64_t memory;       /* bytes */
  uint64_t max_alloc;    /* bytes of the largest single buffer */
  uint64_t local_memory; /* bytes per work-group */
  uint64_t max_work_group;
  int32_t compute_units;
  int32_t event_profiling; /* 1: device events carry times; 0: profiles are timed on the host */
  int32_t fp16, fp64, subgroups;
  vsplat_kernels kernels; /* open device: the flavour in use; in a list: AUTO */
  int32_t has_uuid;       /* 1: the driver reports `uuid` (cl_khr_device_uuid), the same as in Vulkan and CUDA */
  uint8_t uuid[16];
  int32_t has_pci; /* 1: the driver reports the device's place on the bus (cl_khr_pci_bus_info, or the vendor's
                      extension) */
  uint32_t pci_domain, pci_bus, pci_device, pci_function;
  char tuning[72];  /* open device: SHA-256 of the tuned parameters in use (vsplat/tune.h); "" with the defaults. On one
                       device, equal values give equal bits */
  char limits[256]; /* how VSPLAT_LIMITS of the environment changes the values above, as it states it; "": not at all */
  /* Open device: what a self-test (vsplat_selftest) has found wrong, and the library therefore does not use, in words:
     "gpu kernels, CLBlast". "" if nothing. */
  char switched_off[256];
  int32_t fitness;            /* stored verdict of its last self-test, a vsplat_fitness (vsplat/selftest.h); 0: none */
  vsplat_precision precision; /* of an open device */
  /* Open device in mixed precision, what multiplies: "ptx", "dpas", "wmma", "mfma", "avx512bf16", "amx", "emulated". On
     one device, equal values give equal bits. "" in fp32. */
  char matrix_unit[16];
} vsplat_device_info;
#define VSPLAT_DEVICE_INFO_INIT                                                                              \
  {                                                                                                          \
    sizeof(vsplat_device_info), 0, 0, 0, VSPLAT_DEVICE_OTHER, "", "", "", "", "", 0, 0, 0, 0, 0, 0, 0, 0, 0, \
        VSPLAT_KERNELS_AUTO, 0, {0}, 0, 0, 0, 0, 0, "", "", "", 0, VSPLAT_PRECISION_FP32, ""                 \
  }

/* Number of OpenCL devices over all platforms; 0 without a platform. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_count(size_t* out_count);
/* Describes device `index` < vsplat_device_count without opening it. Set out_info->size before the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_describe(size_t index, vsplat_device_info* out_info);

typedef struct vsplat_device_options {
  size_t size;
  /* Flat index ("0"), platform:device ("0:1"), type ("cpu", "gpu", "acc": the first of that type), or a part of the
     name of a device, its platform or its vendor that matches no other device. NULL or "": VSPLAT_DEVICE of the
     environment, else the first GPU, else the first device. Never falls back to another device. */
  const char* device;
  vsplat_kernels kernels;
  vsplat_gemm gemm;
  double max_memory_gib; /* memory that plans assume; 0: what the device reports */
  /* Called before each kernel is compiled, with its name and the number compiled before it on this device. May be
     NULL. */
  void (*on_compile)(void* user, const char* kernel, int32_t compiled);
  void* user;
  /* MIXED together with CLBlast is VSPLAT_ERROR_USAGE; so is MIXED with the cpu kernels, requested by name, on a
     device without instructions for it. The first use on a device
     tests its matrix units, which takes some seconds. */
  vsplat_precision precision;
} vsplat_device_options;
#define VSPLAT_DEVICE_OPTIONS_INIT \
  { sizeof(vsplat_device_options), NULL, VSPLAT_KERNELS_AUTO, VSPLAT_GEMM_AUTO, 0.0, NULL, NULL, VSPLAT_PRECISION_FP32 }

/* Opens a device. `options` NULL: all defaults. VSPLAT_ERROR_DEVICE: no such device (the message lists all devices), or
   a self-test (vsplat_selftest) has found it unusable. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_open(const vsplat_device_options* options,
                                                             vsplat_device* out_device);
/* Makes a stream of an opened device: a device handle that every call accepts in place of the device. It computes on
   another thread at the same time as the device, with a queue and working memory of its own. Streams share the device's
   compiled programs, models' weights and memory limit. Results are equal to the bit. May be called while the device is
   in use. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_stream_create(vsplat_device device, vsplat_device* out_stream);
VSPLAT_API void vsplat_device_retain(vsplat_device device);
VSPLAT_API void vsplat_device_release(vsplat_device device);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_get_info(vsplat_device device, vsplat_device_info* out_info);

/* Stops the call that is using the device; callable from any thread or signal handler; returns at once. The stopped
   call ends with VSPLAT_ERROR_CANCELLED at its next kernel launch, once the work enqueued before is done: some 50 ms of
   work and one kernel. A kernel that is being compiled is finished first, which takes seconds with some drivers
   (vsplat_device_prepare compiles ahead). The stopped call produces nothing and leaves all objects as they were. A
   training writes a checkpoint of its last whole step; a fit (vsplat/fit.h) continues with its next step. Does
   nothing if no call is using the device. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_cancel(vsplat_device device);

/* Frees device memory that is cached for the next call: the last scene drawn and the weights of models that no call
   uses, for all streams, and the working memory of this one. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_trim(vsplat_device device);

typedef enum vsplat_profile_format {
  VSPLAT_PROFILE_JSON = 1,  /* {"device", "driver", "wall_s", "wall", "peak_bytes", "kernels": [...], ...} */
  VSPLAT_PROFILE_TRACE = 2, /* Chrome's and Perfetto's trace events */
  VSPLAT_PROFILE_TABLE = 3, /* text table */
  VSPLAT_PROFILE_PAGE = 4   /* self-contained HTML: timeline, roofline, tables */
} vsplat_profile_format;

/* Starts (on != 0) or stops recording. Recorded are every kernel's time, and what the host does in calls of the library
   meanwhile, in all threads of the process. Starting clears an earlier recording. Wall time is the time during which
   recording is on. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile(vsplat_device device, int32_t on);
/* Starts recording what the host does. The next profile started in the process then begins `seconds_ago` (0 to 1e9)
   before this call. Use it to profile a whole run, with what happens before a device is open. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_profile_begin(double seconds_ago);
/* Sets the subject that profiles of the device show, in place of an earlier one: ("model", "small.safetensors"). It is
   shown as given; both strings are UTF-8 and are copied. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_name(vsplat_device device, const char* what,
                                                                     const char* name);
/* The recording so far, with the wall time until this call. JSON and PAGE compare it with the device's peak rates.
   These are measured once per device and driver, outside the recording's wall time, in some tenths of a second, and are
   cached on disk. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_text(vsplat_device device, vsplat_profile_format format,
                                                                     char** out_text);

/* The launches of one kernel in one stage; transfers have the stage "transfer". */
typedef struct vsplat_profile_row {
  size_t size;
  char kernel[64], stage[32]; /* cut if longer */
  uint64_t calls;
  double seconds;         /* total run time */
  double least, most;     /* shortest and longest single run */
  double queued;          /* total seconds that they waited before they ran */
  uint64_t first_calls;   /* how many of these are a kernel's first launch with a work-group size, in which some drivers
                             compile */
  double first_seconds;   /* total run time of those */
  double flops, bytes;    /* by the definition of what is computed; 0: unknown */
  double performed_flops; /* FLOPs really done, if the method needs fewer; else equal to flops */
  int32_t timed_on_host;  /* 1: the device reports no times, so the host waits for each launch and times it */
} vsplat_profile_row;
#define VSPLAT_PROFILE_ROW_INIT \
  { sizeof(vsplat_profile_row), "", "", 0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0 }

/* Number of rows recorded so far. Waits for everything that has been launched. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_count(vsplat_device device, size_t* out_count);
/* Row `index`; rows are sorted by time, longest first. Set out_row->size before the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_get(vsplat_device device, size_t index,
                                                                    vsplat_profile_row* out_row);

#ifdef __cplusplus
}
#endif

#endif
