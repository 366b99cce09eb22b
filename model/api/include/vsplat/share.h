/* Work of many independent items, shared out over devices. Included by vsplat.h. */
#ifndef VSPLAT_SHARE_H
#define VSPLAT_SHARE_H

#include <vsplat/device.h>
#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Does item `item` on `device`, devices[index], by the calls of this interface: on the calling thread for the first
   device, on a thread of its own for each other one. Returns VSPLAT_OK, or the status of the call that failed, whose
   sentence is then vsplat_last_error()'s. */
typedef vsplat_status (*vsplat_share_function)(void* user, vsplat_device device, size_t index, size_t item);

typedef struct vsplat_share_options {
  size_t size;
  /* How many items may be begun beyond the first that is not done: bounds what waits for its turn. 0: eight times as
     many as there are devices. */
  size_t ahead;
  /* May be NULL. An item and all before it are done: told in order, one at a time, on any of the threads. What is not
     VSPLAT_OK ends the whole with that status; VSPLAT_ERROR_CANCELLED where the program has had enough. */
  vsplat_status (*on_done)(void* user, size_t item);
  /* May be NULL. devices[index] has failed at an item, which another one does: it gets no more work. One at a time;
     `error` is valid during the call. A warning is told in any case (vsplat_log_set). */
  void (*on_lost)(void* user, size_t index, size_t item, const char* error);
  void* user; /* of the functions, `work` among them */
} vsplat_share_options;
#define VSPLAT_SHARE_OPTIONS_INIT \
  { sizeof(vsplat_share_options), 0, NULL, NULL, NULL }

/* Calls `work` once for each of `count` items. A device that is free takes the next one in order, so that a faster one
   does more of them. One that fails with VSPLAT_ERROR_DEVICE, _COMPILE or _MEMORY (the host's is told so, too) gets no more, and its
   item goes to another; whatever else fails ends the whole when what was begun is done, with the status and the sentence of the
   first such item. On devices of the same kind (device, driver, flavour of kernels) the results do not depend on which
   of them does an item; on others they are equal within what floating point leaves. Streams of a device count as
   devices; the same handle twice is VSPLAT_ERROR_USAGE. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_share_out(const vsplat_device* devices, size_t num_devices,
                                                           size_t count, vsplat_share_function work,
                                                           const vsplat_share_options* options);

#ifdef __cplusplus
}
#endif

#endif
