/* Statuses, text that goes in and out, messages, and what a program says about files and memory.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_STATUS_H
#define VSPLAT_STATUS_H

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
   thread that uses the library, one at a time. It may call the library; messages of those calls are dropped. */
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

/* For the whole process; `rules` NULL: the defaults. The functions may be called from any thread that uses the library,
   one at a time, and may call it: where they write a file that is there, they are asked about that one, too. */
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

#ifdef __cplusplus
}
#endif

#endif
