/* Ranks: processes that work together, started by mpirun, on one machine or on many. Included by vsplat.h. */
#ifndef VSPLAT_RANKS_H
#define VSPLAT_RANKS_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Joins the other ranks. Returns this process's rank and the number of ranks; 0 of 1 if mpirun did not start it.
   VSPLAT_ERROR_USAGE: there are several ranks, but the library was built without its MPI module (VSPLAT_MPI), so each
   would do all of the work. The process leaves when it exits. A process that initialises MPI itself does so before this
   call, with MPI_THREAD_SERIALIZED or more. Afterwards all ranks make the same calls, each from one thread and with
   equal arguments except the device: those with vsplat_train_options.ranks or vsplat_evaluate_options.ranks, and
   vsplat_ranks_gather. Every rank must be able to read the files. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_ranks_join(int32_t* out_rank, int32_t* out_count);

/* Called on rank 0 with the text of each rank, in order; the text is valid during the call. */
typedef void (*vsplat_rank_text_function)(void* user, int32_t rank, const char* text);

/* Every rank sends a text to rank 0, whose function is called for each, its own included. The other ranks' functions
   are not called. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_ranks_gather(const char* text, vsplat_rank_text_function on_text,
                                                              void* user);

/* Ends all ranks when this one cannot continue, so that none waits for it. Does not return if there are several
   ranks. */
VSPLAT_API void vsplat_ranks_abort(int32_t exit_code);

#ifdef __cplusplus
}
#endif

#endif
