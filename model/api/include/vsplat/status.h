/* Statuses, strings, messages, and a program's rules for files and memory. Part of vsplat.h, which states the common
   conventions. */
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
  VSPLAT_ERROR_USAGE = 1,     /* the request itself is wrong: a null handle, an unknown field, a view that does not
                                 exist */
  VSPLAT_ERROR_FILE = 2,      /* a file cannot be read or written, or exists already */
  VSPLAT_ERROR_FORMAT = 3,    /* a file's content is damaged or does not follow its format */
  VSPLAT_ERROR_INPUT = 4,     /* well-formed input that cannot be used: a singular pose, a cube behind the cameras */
  VSPLAT_ERROR_DEVICE = 5,    /* no such device, no platform, a driver's error */
  VSPLAT_ERROR_COMPILE = 6,   /* a kernel did not compile; the message holds the build log */
  VSPLAT_ERROR_MEMORY = 7,    /* more memory is needed than available; the message holds both figures */
  VSPLAT_ERROR_CANCELLED = 8, /* a progress function asked to stop, or vsplat_device_cancel */
  VSPLAT_ERROR_INTERNAL = 9,  /* a bug in the library */
  VSPLAT_ERROR_BUSY = 10      /* the device is in use by a call of another thread, or by the one whose callback calls */
} vsplat_status;

/* "usage", "file", ...; "unknown" for other values. The text is static. */
VSPLAT_API const char* vsplat_status_name(vsplat_status status);

/* The error message of this thread's last failed call; "" before the first failure. Valid until the next failure on
   this thread. */
VSPLAT_API const char* vsplat_last_error(void);

/* The library's VSPLAT_VERSION, and its "major.minor.patch". */
VSPLAT_API uint32_t vsplat_version(void);
VSPLAT_API const char* vsplat_version_string(void);

/* Frees a string that a call returned; NULL is fine. */
VSPLAT_API void vsplat_text_free(char* text);

typedef enum vsplat_log_level {
  VSPLAT_LOG_WARNING = 1, /* worth the user's attention: frames without pictures, nothing selected */
  VSPLAT_LOG_INFO = 2,    /* what was found and chosen: the views, the cube */
  VSPLAT_LOG_VERBOSE = 3  /* details for debugging */
} vsplat_log_level;

/* `text` is one message without a line break, valid during the call. */
typedef void (*vsplat_log_function)(void* user, vsplat_log_level level, const char* text);

/* Sets where messages go, for the whole process. NULL, the initial state, silences them. The function may be called
   from any thread that uses the library, one call at a time. It may call the library; messages of those calls are
   dropped. */
VSPLAT_API void vsplat_log_set(vsplat_log_function function, void* user);

/* What messages call the options of this interface, for the whole process. At first these are the fields and functions
   of C: "not enough device memory: ... (vsplat_device_options.max_memory_gib, fewer views, ...)". A program whose users
   know other names, such as a command line, sets those: what messages call fields[i], such as
   "vsplat_device_options.max_memory_gib" or "vsplat_doctor", is then called names[i]. All others are called as in C;
   with `count` 0 all are. The texts are copied. VSPLAT_ERROR_USAGE: no message names fields[i]. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_option_names_set(const char* const* fields, const char* const* names,
                                                                  size_t count);

/* A program's rules for the files that the library writes and reads. Each file is written under another name and then
   renamed, so it appears whole or not at all. A file that another file names (the pictures and masks of a list of
   cameras; a mesh's materials, textures and buffers) is read only if, with links followed, it lies in the folder of the
   file that names it, in a folder passed to a call, or in the picture folder of a COLMAP model. */
typedef struct vsplat_file_rules {
  size_t size;
  int32_t (*may_replace)(void* user, const char* path); /* a file exists where another is to be written: 0 keeps it, and
                                                           the call ends with VSPLAT_ERROR_FILE; NULL: it is replaced */
  void (*on_written)(void* user, const char* path, int32_t created); /* a file was put in place; `created`: there was
                                                                        none before; may be NULL */
  void* user;
  int32_t allow_outside; /* not 0: files named by files may lie anywhere; only for input from trusted sources */
} vsplat_file_rules;
#define VSPLAT_FILE_RULES_INIT \
  { sizeof(vsplat_file_rules), NULL, NULL, NULL, 0 }

/* Sets the rules for the whole process; `rules` NULL: the defaults. The functions may be called from any thread that
   uses the library, one call at a time. They may call the library; if they write over an existing file, they are asked
   about that one too. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_file_rules_set(const vsplat_file_rules* rules);

/* Limits the host memory that may be used, in bytes, for the whole process. 0, the initial value: three quarters of the
   memory that is free when the limit is first needed, less if control groups and `ulimit -v` allow less. A call that
   reads a picture reserves what it will hold; beyond the limit it ends with VSPLAT_ERROR_MEMORY and both figures. A CPU
   device's buffers are in the same memory: they are reserved too, and the device plans within this limit unless
   vsplat_device_options.max_memory_gib says otherwise. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_set_host_memory(uint64_t bytes);
/* Bytes that may be used, and bytes reserved now; either may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_get_host_memory(uint64_t* out_limit, uint64_t* out_reserved);

/* Writes a file of the program's own, by the same rules as the library's files. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_file_write(const char* path, const void* data, size_t bytes);

/* Called during a computation with the current `stage`, named as in a profile ("encoder", "lifting", ...), and the
   share of the total work that is done, in [0,1]. Return 0 to stop: the call then ends with VSPLAT_ERROR_CANCELLED. */
typedef int32_t (*vsplat_progress_function)(void* user, const char* stage, double done);

#ifdef __cplusplus
}
#endif

#endif
