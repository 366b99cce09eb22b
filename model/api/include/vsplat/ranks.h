/* Processes that work together, as mpirun starts them: ranks, on one machine or on many. Included by vsplat.h. */
#ifndef VSPLAT_RANKS_H
#define VSPLAT_RANKS_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Joins the others: which of them this process is, and how many there are. Rank 0 of 1 where mpirun did not start it.
   VSPLAT_ERROR_USAGE where it is one of several and the library was built without its module for MPI (VSPLAT_MPI), since
   each would do all of the work. The process leaves them when it exits; one that initialises MPI itself
   does so before, with MPI_THREAD_SERIALIZED or more.
   Then all ranks make the same calls with vsplat_train_options.ranks or vsplat_evaluate_options.ranks, with the same
   arguments but for the device, one thread of each, and vsplat_ranks_gather; the files are where each can read them. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_ranks_join(int32_t* out_rank, int32_t* out_count);

/* Called on rank 0 with the text of each rank, in order, valid during the call. */
typedef void (*vsplat_rank_text_function)(void* user, int32_t rank, const char* text);

/* Every rank gives a text to rank 0, whose function is called for each, its own among them; that of others is not. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_ranks_gather(const char* text, vsplat_rank_text_function on_text,
                                                              void* user);

/* Ends all ranks where this one cannot go on, so that none waits for it; does not return where there are several. */
VSPLAT_API void vsplat_ranks_abort(int32_t exit_code);

#ifdef __cplusplus
}
#endif

#endif
