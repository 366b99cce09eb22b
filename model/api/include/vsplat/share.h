/* Distributes many independent items of work over devices. Included by vsplat.h. */
#ifndef VSPLAT_SHARE_H
#define VSPLAT_SHARE_H

#include <vsplat/device.h>
#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Does item `item` on `device`, which is devices[index], through the calls of this interface. It runs on the calling
   thread for the first device, and on a thread of its own for each other device. Returns VSPLAT_OK, or the status of
   the call that failed, whose message vsplat_last_error() then has. */
typedef vsplat_status (*vsplat_share_function)(void* user, vsplat_device device, size_t index, size_t item);

typedef struct vsplat_share_options {
  size_t size;
  /* How many items may be begun beyond the first unfinished one: bounds the results that wait for their turn. 0: eight
     times the number of devices. */
  size_t ahead;
  /* May be NULL. Called when an item and all before it are done: in order, one at a time, on any of the threads. Any
     status but VSPLAT_OK ends the whole with that status; return VSPLAT_ERROR_CANCELLED to stop early. */
  vsplat_status (*on_done)(void* user, size_t item);
  /* May be NULL. Called when devices[index] has failed at an item: it gets no more work, and another device does the
     item. One call at a time; `error` is valid during the call. The library logs a warning in any case
     (vsplat_log_set). */
  void (*on_lost)(void* user, size_t index, size_t item, const char* error);
  void* user; /* argument of the functions, `work` included */
} vsplat_share_options;
#define VSPLAT_SHARE_OPTIONS_INIT \
  { sizeof(vsplat_share_options), 0, NULL, NULL, NULL }

/* Calls `work` once for each of `count` items. A free device takes the next item in order, so a faster one does more. A
   device whose item fails with VSPLAT_ERROR_DEVICE, _COMPILE or _MEMORY (host memory included) gets no more items, and
   another device does that item. Any other failure ends the whole once the items in progress are done, with the status
   and the message of the first failed item. On devices of the same kind (device, driver, flavour of kernels) the
   results do not depend on which of them does an item; on different kinds they agree up to floating-point rounding.
   Streams of a device count as devices; passing a handle twice is VSPLAT_ERROR_USAGE. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_share_out(const vsplat_device* devices, size_t num_devices,
                                                           size_t count, vsplat_share_function work,
                                                           const vsplat_share_options* options);

#ifdef __cplusplus
}
#endif

#endif
