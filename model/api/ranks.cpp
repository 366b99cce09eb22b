// Processes that work together.
#include "runtime/system/ranks.h"

#include "model/api/handle.h"

using namespace vsplat;
using namespace vsplat::api;

vsplat_status vsplat_ranks_join(int32_t* out_rank, int32_t* out_count) {
  return guarded([&] {
    need(out_rank, "out_rank");
    need(out_count, "out_count");
    const Ranks& ranks = Ranks::world();
    *out_rank = ranks.rank();
    *out_count = ranks.count();
  });
}

vsplat_status vsplat_ranks_gather(const char* text, vsplat_rank_text_function on_text, void* user) {
  return guarded([&] {
    need(text, "text");
    if (!on_text) fail(Status::usage, "on_text is null");
    Ranks& ranks = Ranks::world();
    if (ranks.rank() > 0) {
      MessageOut out;
      ranks.send(0, out.add(std::string(text)).bytes());
      return;
    }
    on_text(user, 0, text);
    for (int rank = 1; rank < ranks.count(); ++rank)
      on_text(user, rank, MessageIn(ranks.receive(rank)).take_text().c_str());
  });
}

void vsplat_ranks_abort(int32_t exit_code) {
  const vsplat_status ended = guarded([&] { Ranks::world().abort(exit_code); });
  (void)ended;
}
