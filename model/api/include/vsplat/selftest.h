/* Tests whether a device computes correctly. Part of vsplat.h, which states the common conventions. */
#ifndef VSPLAT_SELFTEST_H
#define VSPLAT_SELFTEST_H

#include <vsplat/device.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum vsplat_fitness {
  VSPLAT_FITNESS_OK = 1,
  VSPLAT_FITNESS_DEGRADED = 2, /* something is wrong and is replaced: see vsplat_device_info.switched_off */
  VSPLAT_FITNESS_UNUSABLE = 3  /* something is wrong and cannot be replaced: the device can no longer be opened */
} vsplat_fitness;

typedef struct vsplat_selftest_options {
  size_t size;
  const char* device;                /* as in vsplat_device_options */
  int32_t quick;                     /* not 0: fewer sizes of everything */
  int32_t forget;                    /* not 0: the verdict is not stored */
  vsplat_progress_function progress; /* stages "cpu kernels", "gpu kernels"; may be NULL */
  /* As in vsplat_device_options. May be NULL. */
  void (*on_compile)(void* user, const char* kernel, int32_t compiled);
  void* user;
  const char* ended; /* in words, how the process ended in which the last self-test of this device ran: see below; NULL
                        or "": unknown */
} vsplat_selftest_options;
#define VSPLAT_SELFTEST_OPTIONS_INIT \
  { sizeof(vsplat_selftest_options), NULL, 0, 0, NULL, NULL, NULL, NULL }

/* Runs every kernel in both flavours, and the network's stages, on a device, and compares the results with scalar
   implementations on the host and with PyTorch's. Each runs twice and must give equal bits. What is wrong is tested
   again without the parts that the library can do without. The function opens the device itself, in any state, whatever
   an earlier self-test has stored. The verdict for this device, driver and these kernels is stored in the cache folder,
   for all processes: vsplat_device_open then leaves out what is switched off, and refuses an unusable device with
   VSPLAT_ERROR_DEVICE. VSPLAT_SELFTEST=ignore in the environment uses it anyway. A quick test does not replace a worse
   verdict of an earlier test. With VSPLAT_KERNEL_DIR nothing is stored, unless VSPLAT_CACHE_DIR names a folder.

   A driver that crashes ends the caller's process; `vsplat selftest` therefore runs it in a process of its own. A
   self-test writes each action to the cache folder before doing it. A later self-test that finds an action there that
   did not return takes it for wrong without doing it, if `ended` says how that process ended, or if it did not return
   twice. The self-test after one that ran to its end tries it again.

   `options` NULL: defaults. `out_text`, unless it is NULL, becomes JSON, to be freed with vsplat_text_free: {"verdict":
   "ok", "degraded" or "unusable", "off": [names], "off_in_words", "worst", "date", "device", "driver", "quick",
   "mixed_loss": dB of PSNR that mixed precision costs on a built-in object, null if it is not known, "remembered":
   "now", "before" (a worse one stays) or "no", "flavours": [{"flavour", "usable", "off", "results",
   "kernels": [{"kernel", "file", "options", "verdict": "ok", "wrong" or "in doubt", "results", "wrong", "what",
   "error", "tolerance"}], "wrong": [{"what", "kernels", "error", "tolerance", "trouble"}], "tuned": [{"what", "error",
   "right", "why"}], "untested": [kernels that no case launches]}]}. `tuned` are the choices of the device's table
   (vsplat/tune.h), with their errors relative to the tolerance; wrong ones are removed from it. `error` is the largest
   difference relative to the largest value, null if a value is not a number; for a kernel, that of its worst result. A
   kernel is in doubt if it has no right result, but another kernel explains that. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_selftest(const vsplat_selftest_options* options,
                                                          vsplat_fitness* out_fitness, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
