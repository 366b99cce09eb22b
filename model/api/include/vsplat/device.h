/* OpenCL devices: which there are, open ones, streams of them, and their profiles.
   Part of vsplat.h, which says what holds for all of it. */
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

/* Which family of dense kernels runs; both run on every device. */
typedef enum vsplat_kernels {
  VSPLAT_KERNELS_AUTO = 0, /* the environment's VSPLAT_KERNELS, else by the device's traits */
  VSPLAT_KERNELS_CPU = 1,  /* a work-item owns a register tile */
  VSPLAT_KERNELS_GPU = 2   /* a work-group tiles through local memory */
} vsplat_kernels;

/* Who multiplies plain matrices. */
typedef enum vsplat_gemm {
  VSPLAT_GEMM_AUTO = 0,   /* our own kernels */
  VSPLAT_GEMM_OWN = 1,    /* the library's own kernels */
  VSPLAT_GEMM_CLBLAST = 2 /* CLBlast */
} vsplat_gemm;

/* In what numbers large products of matrices are made: those of the network, when it computes a scene. Drawing, moving
   a scene towards pictures and what pictures are measured by are fp32 in either, and so is training, which is refused
   in mixed precision. */
typedef enum vsplat_precision {
  VSPLAT_PRECISION_FP32 = 0, /* floats throughout */
  VSPLAT_PRECISION_MIXED = 1 /* operands rounded to bf16, sums in fp32, by the device's matrix units where these have
                                passed a test on it, else emulated, which is slower than fp32; gpu kernels alone */
} vsplat_precision;

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
  char tuning[72];  /* of an open device: the SHA-256 of the tuned parameters that it runs with (vsplat/tune.h); "":
                      none, the defaults. Equal ones give equal bits on one device */
  char limits[256]; /* what the environment's VSPLAT_LIMITS makes of the above, as it says; "": nothing */
  /* Of an open device: what a self-test (vsplat_selftest) has found wrong, and is not used, in words: "gpu kernels,
     CLBlast". Empty where nothing is. */
  char switched_off[256];
  int32_t fitness; /* what is remembered of its last self-test, a vsplat_fitness (vsplat/selftest.h); 0: of none */
  vsplat_precision precision; /* of an open device */
  /* Of one in mixed precision, who multiplies: "ptx", "dpas", "wmma", "mfma", "emulated". Equal ones give equal bits on
     one device. "" in fp32. */
  char matrix_unit[16];
} vsplat_device_info;
#define VSPLAT_DEVICE_INFO_INIT                                                                              \
  {                                                                                                          \
    sizeof(vsplat_device_info), 0, 0, 0, VSPLAT_DEVICE_OTHER, "", "", "", "", "", 0, 0, 0, 0, 0, 0, 0, 0, 0, \
        VSPLAT_KERNELS_AUTO, 0, {0}, 0, 0, 0, 0, 0, "", "", "", 0, VSPLAT_PRECISION_FP32, ""                 \
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
  /* MIXED: VSPLAT_ERROR_USAGE beside the cpu kernels, or CLBlast, asked for by name. The first time on a device its
     matrix units are tried, which takes some seconds. */
  vsplat_precision precision;
} vsplat_device_options;
#define VSPLAT_DEVICE_OPTIONS_INIT \
  { sizeof(vsplat_device_options), NULL, VSPLAT_KERNELS_AUTO, VSPLAT_GEMM_AUTO, 0.0, NULL, NULL, VSPLAT_PRECISION_FP32 }

/* Opens a device. `options` NULL: all defaults. VSPLAT_ERROR_DEVICE with a list where there is no such device, and
   where a self-test (vsplat_selftest) has found it unusable. */
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
   one kernel (one that is compiled just then is compiled first, seconds on some drivers: vsplat_device_prepare does it
   ahead): what it would have made is not made, what was there before is as it was. A training writes a checkpoint of
   its last whole step, a refinement goes on at its next step. Nothing happens where no call has the device. */
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

/* The launches of one kernel in one stage, and the transfers, whose stage is "transfer". */
typedef struct vsplat_profile_row {
  size_t size;
  char kernel[64], stage[32]; /* cut where they are longer */
  uint64_t calls;
  double seconds;         /* that they ran, in all */
  double least, most;     /* of one */
  double queued;          /* seconds that they waited before they ran, in all */
  uint64_t first_calls;   /* of these: first launches of a kernel with a work-group, which some drivers compile in */
  double first_seconds;   /* that those ran */
  double flops, bytes;    /* by the definition of what is computed; 0: not told */
  double performed_flops; /* where a method gets by with fewer; else the same */
  int32_t timed_on_host;  /* 1: the device tells no times; each launch is then waited for */
} vsplat_profile_row;
#define VSPLAT_PROFILE_ROW_INIT \
  { sizeof(vsplat_profile_row), "", "", 0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0, 0 }

/* How many rows there are of what was recorded so far. Waits for what has been launched. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_count(vsplat_device device, size_t* out_count);
/* Row `index`, the one that took most time being the first. Set out_row->size before. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_profile_get(vsplat_device device, size_t index,
                                                                    vsplat_profile_row* out_row);

#ifdef __cplusplus
}
#endif

#endif
