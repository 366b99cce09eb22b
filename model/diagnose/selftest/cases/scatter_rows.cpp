#include "model/diagnose/selftest/reference/scatter_rows.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/dense/scatter_rows.h"

namespace vsplat::selftest {
namespace {

struct ScatterTry {
  long entries, rows, channels, per_row;
  long first = 0;
  float scale = 1, low = -1;  // `low`: the least number of d, the largest being 1
};

// A weight of 0 keeps whatever its entry's row of d holds from the result, so those that nothing else reads are NaN.
void scatter_rows_of(Checks& c, const ScatterTry& t, const std::vector<int>& index, const std::vector<float>& weight) {
  const long used = t.first + (t.entries + t.per_row - 1) / t.per_row;
  auto d = random_floats(size_of(used + 2, t.channels), 7, t.low);
  const auto before = random_floats(size_of(t.rows, t.channels), 8);
  std::vector<double> want(before.begin(), before.end());
  ref::scatter_rows(index, weight, d, size_of(t.channels), size_of(t.first), size_of(t.per_row),
                    static_cast<double>(t.scale), want);
  for (std::size_t e = 0; t.per_row == 1 && e < index.size(); ++e)
    if (index[e] < 0 || weight[e] == 0) d[(size_of(t.first) + e) * size_of(t.channels)] = NAN;
  const ScatterPlan plan = make_scatter_plan(c.ctx, c.up({t.entries}, index), c.up({t.entries}, weight), t.rows);
  const Tensor rows = c.up({used + 2, t.channels}, d);
  for (int time = 0; time < 2; ++time) {  // the plan serves again
    const Tensor out = c.up({t.rows, t.channels}, before);
    scatter_rows(c.ctx, {&plan, rows, t.first, t.per_row, t.scale, out});
    c.close("sums", out, want, 1e-6);
  }
}

// Indices from -1 on, so that some entries are passed over; every fifth weight is 0.
void scatter_rows_of(Checks& c, const ScatterTry& t) {
  std::vector<int> index(size_of(t.entries));
  std::mt19937 engine(5);
  for (int& i : index) i = static_cast<int>(engine() % static_cast<unsigned>(t.rows + 1)) - 1;
  if (t.entries > 0) index[0] = 0;
  auto weight = random_floats(index.size(), 6, -1.0f, 2.0f);
  for (std::size_t e = 4; e < weight.size(); e += 5) weight[e] = 0;
  scatter_rows_of(c, t, index, weight);
}

void scatter_rows_all(Checks& c) {
  for (const ScatterTry& t : c.some({ScatterTry{1, 1, 1, 1},
                                     {7, 5, 6, 1},
                                     {63, 2, 4, 1},
                                     {64, 3, 5, 1},
                                     {65, 257, 3, 1},
                                     {101, 7, 17, 1},
                                     {240, 11, 18, 4},
                                     {97, 11, 33, 4, 13, 0.25f},
                                     {4099, 2, 1, 4}},
                                    {{97, 11, 18, 4, 13, 0.25f}, {100000, 2, 1, 4, 0, 1, 0.0f}}))
    scatter_rows_of(c, t);
  if (!c.all) return;
  for (const long channels : {1L, 3L, 4L, 5L, 15L, 16L, 17L, 33L, 129L}) scatter_rows_of(c, {101, 7, channels, 1});
  for (const long entries : {0L, 1L, 3L, 7L, 63L, 64L, 65L, 1023L, 1024L, 1025L})
    scatter_rows_of(c, {entries, 5, 6, 1});
  for (const long rows : {1L, 2L, 3L, 255L, 256L, 257L, 5000L}) scatter_rows_of(c, {997, rows, 3, 1});
  for (const long per_row : {2L, 4L, 12L, 16L, 60L}) scatter_rows_of(c, {240, 11, 18, per_row});
  // Windows of 64 sorted entries: runs that begin or end with one, span several, and are empty between.
  std::vector<int> index;
  int row = 0;
  for (const std::size_t length : {64, 64, 0, 1, 63, 128, 0, 65, 1, 126, 200, 3, 256, 1})
    index.insert(index.end(), length, row++);
  for (const long channels : {1L, 4L, 19L})
    scatter_rows_of(c, {static_cast<long>(index.size()), row, channels, 1}, index,
                    random_floats(index.size(), 6, 0.5f, 2.0f));
}

}  // namespace

VSPLAT_CASES(scatter_rows, {"scatter_rows", scatter_rows_all})

}  // namespace vsplat::selftest
