/* Whether a device computes rightly.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_SELFTEST_H
#define VSPLAT_SELFTEST_H

#include <vsplat/device.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum vsplat_fitness {
  VSPLAT_FITNESS_OK = 1,
  VSPLAT_FITNESS_DEGRADED =
      2, /* something is wrong, and something else does its work: see vsplat_device_info.switched_off */
  VSPLAT_FITNESS_UNUSABLE = 3 /* nothing else does: the device is not opened any more */
} vsplat_fitness;

typedef struct vsplat_selftest_options {
  size_t size;
  const char* device;                /* as vsplat_device_options.device */
  int32_t quick;                     /* not 0: fewer sizes of everything */
  int32_t forget;                    /* not 0: what was found holds for this call alone */
  vsplat_progress_function progress; /* stages "cpu kernels", "gpu kernels"; may be NULL */
  /* As vsplat_device_options.on_compile. May be NULL. */
  void (*on_compile)(void* user, const char* kernel, int32_t compiled);
  void* user;
  const char* ended; /* how the process was ended that a self-test of this device ran in last, in words: see below;
                        NULL or "": not known */
} vsplat_selftest_options;
#define VSPLAT_SELFTEST_OPTIONS_INIT \
  { sizeof(vsplat_selftest_options), NULL, 0, 0, NULL, NULL, NULL, NULL }

/* Runs every kernel, of both flavours, and the network's stages on a device, and holds the results against scalar
   implementations on the host, and those of PyTorch; each twice, to the same bits. What is wrong is tried without what
   it can be done without. Opens the device by itself: in any state, whatever an earlier self-test has left.

   What was found is remembered in the cache's folder for this device, with this driver and these kernels, in all
   processes: vsplat_device_open leaves out what is switched off, and refuses a device that is unusable, with
   VSPLAT_ERROR_DEVICE. VSPLAT_SELFTEST=ignore in the environment uses it all the same. A quick test replaces no worse
   verdict of an earlier one. With VSPLAT_KERNEL_DIR nothing is remembered, but where VSPLAT_CACHE_DIR names a folder.

   A driver that crashes takes the caller's process with it: `vsplat selftest` has one of its own for that. What a
   self-test is doing is written into the cache's folder before it is done, and one that finds there what another did not
   come back from takes that for wrong without doing it: where `ended` says how that process was ended, or where it has
   been twice. It is tried again by the self-test after one that came to its end.

   `options` NULL: defaults. `out_text`, unless it is NULL, becomes JSON, to be freed with vsplat_text_free: {"verdict":
   "ok", "degraded" or "unusable", "off": [names], "off_in_words", "worst", "date", "device", "driver", "quick", "remembered": "now",
   "before" (a worse one stays) or "no", "flavours": [{"flavour", "usable", "off", "results", "kernels": [{"kernel",
   "file", "options", "verdict": "ok", "wrong" or "in doubt", "results", "wrong", "what", "error", "tolerance"}],
   "wrong": [{"what", "kernels", "error", "tolerance", "trouble"}], "tuned": [{"what", "error", "right", "why"}], "untested": [kernels that no case launches]}]}.
   `tuned` are the choices of the device's table (vsplat/tune.h), their errors by what is allowed: those that are wrong
   are taken out of it.
   `error` is the largest difference by the largest value, null where numbers are none; of a kernel, that of its worst
   result. A kernel is in doubt where it has no right result, but another explains that. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_selftest(const vsplat_selftest_options* options,
                                                          vsplat_fitness* out_fitness, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
