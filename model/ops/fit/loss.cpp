#include "model/ops/fit/loss.h"

#include <algorithm>
#include <initializer_list>
#include <limits>
#include <numeric>
#include <vector>

#include "runtime/blocks.h"
#include "runtime/fail.h"
#include "runtime/rounding.h"
#include "runtime/shape_check.h"
#include "runtime/side_by_side.h"

namespace vsplat {
namespace {

constexpr long kLost = 10, kGroup = 64, kBlock = 64 * 32;  // as cl/fit/loss.cl: WINDOW - 1, GROUP, GROUP * EACH
constexpr long kRows = 4;                                  // ROWS of cl/fit/loss_cpu.cl

struct Scale {
  long height = 0, width = 0;  // of the pictures here
  Tensor m, d, slopes;
  long valid_height() const { return height - kLost; }
  long valid_width() const { return width - kLost; }
};

class Loss {
 public:
  Loss(Context& ctx, const PictureLoss& a, long n, long h, long w)
      : ctx_(ctx), a_(a), n_(n), pictures_(a.pictures), target_(a.target) {
    scales_.resize(a.similarity == SimilarityKind::automatic && std::min(h, w) > 160 ? 5 : 1);
    for (Scale& s : scales_) {
      s.height = h, s.width = w;
      h = (h + 1) / 2, w = (w + 1) / 2;
    }
    means_ = field({1 + similarities(), 3 * n_}, "loss.means");
    by_ = field({similarities(), 3 * n_}, "loss.by");
  }

  void run() {
    if (n_ == 1 && scales_.size() == 1 && scales_[0].height * scales_[0].width > a_.band_pixels) return run_in_bands();
    for (std::size_t i = 0; i < scales_.size(); ++i) {
      const Scale& s = scales_[i];
      differences(i);
      const long pixels = s.height * s.width, windows = s.valid_height() * s.valid_width();
      if (i == 0) total(sums(s.d, pixels, error_sums()), pixels, means_, 0);
      if (similarities() > 0) total(sums(similarity(i), windows, kSums), windows, means_, static_cast<long>(i) + 1);
    }
    value(scales_[0].height);
    if (!a_.dpictures) return;
    if (a_.similarity == SimilarityKind::none) return error_gradient(a_.dpictures);
    Tensor coarser;
    for (std::size_t i = scales_.size(); i-- > 0;) coarser = gradient(i, coarser, a_.dpictures);
  }

 private:
  static constexpr int kSums = 0, kSquares = 1, kAbsolute = 2;  // as in the kernel loss_sums

  bool absolute() const { return a_.error == ErrorKind::absolute; }
  int error_sums() const { return absolute() ? kAbsolute : kSquares; }
  // The number of scales that have a similarity.
  long similarities() const { return a_.similarity == SimilarityKind::none ? 0 : static_cast<long>(scales_.size()); }
  // The factor of an error's slope, which is d or its sign.
  float error_scale() const {
    return (absolute() ? 1.0f : 2.0f) * a_.gradient_scale / static_cast<float>(a_.pictures.count());
  }

  Tensor field(const Shape& shape, const char* what) { return ctx_.tensor(shape, Type::f32, what); }

  // Launches width x rows x pictures work-items, each of which reads and writes `fields` numbers and performs `flops`
  // operations.
  void launch(const char* kernel, long width, long rows, long pictures, double flops, double fields,
              std::initializer_list<KernelArg> args) {
    const double count = static_cast<double>(width) * static_cast<double>(rows) * static_cast<double>(pictures);
    ctx_.launch({"loss", kernel, ""}, groups((width + kGroup - 1) / kGroup, kGroup, rows, pictures),
                {flops * count, 4 * fields * count}, KernelArgs(args.begin(), args.size()));
  }

  // The same for kernels that differ between the flavours: on a CPU a work-item processes `each` whole rows.
  void launch_blur(const char* kernel, long width, long rows, long pictures, double flops, double fields,
                   std::initializer_list<KernelArg> args, long each = 1) {
    if (ctx_.flavour() != Flavour::cpu) return launch(kernel, width, rows, pictures, flops, fields, args);
    const double count = static_cast<double>(width) * static_cast<double>(rows) * static_cast<double>(pictures);
    ctx_.launch({"loss_cpu", kernel, ""}, items(div_up(rows, each) * pictures, 1), {flops * count, 4 * fields * count},
                KernelArgs(args.begin(), args.size()));
  }

  // A picture with one scale, band by band: its fields take a band's memory. A band's rows need those of the windows
  // that they are in.
  void run_in_bands() {
    const bool similar = similarities() > 0;
    const long height = scales_[0].height, width = scales_[0].width;
    // Rows of pictures and of windows that begin where a tensor may.
    const auto align = static_cast<long>(ctx_.memory().limits().align);
    const auto step = [align](long w) { return align / std::gcd(align, 12 * w); };
    const long unit = similar ? std::max(step(width), step(width - kLost)) : step(width);
    const long rows = round_up(a_.band_pixels / width + 1, unit), before = similar ? round_up(kLost, unit) : 0;
    const long bands = (height + rows - 1) / rows;
    const Tensor errors = field({bands, 3}, "loss.totals"), windows = field({bands, 3}, "loss.totals");
    ctx_.fill_zero(windows);
    ctx_.fill_zero(means_);
    value(height);  // its slopes need no means if there is one scale
    const auto part = [&](const Tensor& all, long from, long to) {
      return slice(all.reshaped({all.count() / (3 * width), width, 3}), from, to - from);
    };
    for (const long from : block_starts(ctx_, height, rows)) {
      const long to = std::min(from + rows, height), first = std::max(from - before, 0L);
      Scale& s = scales_[0];
      s = {similar ? std::min(to + kLost, height) - first : to - first, width, {}, {}, {}};
      pictures_ = part(a_.pictures, first, first + s.height);
      target_ = part(a_.target, first, first + s.height);
      differences(0);
      total(sums(part(s.d, from - first, to - first), (to - from) * width, error_sums()), 1, errors, from / rows);
      if (similar) {
        const Tensor off = similarity(0).reshaped({s.valid_height(), s.valid_width(), 3});
        const long own = s.valid_height() - (from - first);
        if (own > 0) total(sums(slice(off, from - first, own), own * s.valid_width(), kSums), 1, windows, from / rows);
      }
      if (!a_.dpictures) continue;
      const Tensor out = part(a_.dpictures, from, to);
      if (!similar) {
        error_gradient(out);
        continue;
      }
      const Tensor whole = field({s.height, width, 3}, "loss.gradient");
      gradient(0, Tensor(), whole);
      ctx_.copy(part(whole, from - first, to - first), out);
    }
    total(errors.reshaped({1, bands, 3}), height * width, means_, 0);
    if (similar) total(windows.reshaped({1, bands, 3}), (height - kLost) * (width - kLost), means_, 1);
    value(height);
  }

  // m and d of scale i, from the pictures or from the scale before.
  void differences(std::size_t i) {
    Scale& s = scales_[i];
    s.m = field({n_, s.height, s.width, 3}, "loss.m");
    s.d = field({n_, s.height, s.width, 3}, "loss.d");
    if (i == 0) {
      const long count = s.m.count();
      launch("loss_differences", count, 1, 1, 4, 4, {pictures_, target_, written(s.m), written(s.d), count});
      return;
    }
    const Scale& finer = scales_[i - 1];
    launch("loss_halve", 3 * s.width, s.height, n_, 10, 10,
           {finer.m, finer.d, written(s.m), written(s.d), finer.height, finer.width});
  }

  // The dissimilarities at scale i, and their slopes.
  Tensor similarity(std::size_t i) {
    Scale& s = scales_[i];
    const long v3 = 3 * s.valid_width(), rows = n_ * s.height;
    const Tensor blurred = field({4, rows, v3}, "loss.rows");
    launch_blur("loss_rows", v3, rows, 1, 110, 6, {s.m, s.d, written(blurred), v3, rows});
    const Tensor off = field({n_, s.valid_height(), v3}, "loss.off");
    if (a_.dpictures) s.slopes = field({3, n_, s.valid_height(), v3}, "loss.slopes");
    const bool structure = i + 1 < scales_.size();
    launch_blur("loss_maps", v3, s.valid_height(), n_, 130, 8,
                {blurred, written(off), written(s.slopes), v3, s.height, n_, structure ? 1 : 0}, kRows);
    return off;
  }

  // Sums of x [N, pixels, 3], of its squares or of its absolute values, over blocks of pixels.
  Tensor sums(const Tensor& x, long pixels, int of) {
    const long blocks = (pixels + kBlock - 1) / kBlock;
    Tensor out = field({n_, blocks, 3}, "loss.sums");
    const auto count = static_cast<double>(x.count());
    const bool cpu = ctx_.flavour() == Flavour::cpu;
    ctx_.launch({cpu ? "loss_cpu" : "loss", "loss_sums", ""}, groups(blocks, cpu ? 1 : kGroup, n_),
                {2 * count, 4 * count}, x, written(out), pixels, of);
    return out;
  }

  // Row `row` of `to`: these sums in all, over `pixels`.
  void total(const Tensor& sums, long pixels, const Tensor& to, long row) {
    ctx_.launch({"loss", "loss_means", ""}, items(3 * n_), {}, sums, written(to, 3 * n_ * row, 3 * n_), 3 * n_,
                sums.dim(1), pixels, 3 * n_ * row);
  }

  // The loss from the means, and its slopes by dissimilarities.
  void value(long height) {
    ctx_.launch({"loss", "loss_value", ""}, items(1, 1), {}, means_, written(a_.out), written(by_), height,
                scales_[0].width, 3 * n_, similarities(), a_.ssim_weight, a_.gradient_scale);
  }

  // Scale 0 writes it to `finest`.
  Tensor gradient(std::size_t i, const Tensor& coarser, const Tensor& finest) {
    Scale& s = scales_[i];
    const long v3 = 3 * s.valid_width(), padded = v3 + 6 * kLost;
    const Tensor spread = field({3, n_, s.height, padded}, "loss.spread");
    launch_blur("loss_backward_spread", padded, s.height, 3 * n_, 22, 2,
                {s.slopes, written(spread), v3, s.height, 3 * n_}, kRows);
    const Tensor out = i == 0 ? finest : field({n_, s.height, s.width, 3}, "loss.gradient");
    launch_blur("loss_backward", 3 * s.width, s.height, n_, 75, 8,
                {spread, s.m, s.d, by_, coarser, i == 0 ? pictures_ : Tensor(), written(out), s.height, s.width, n_,
                 3 * n_ * static_cast<long>(i), error_scale(), absolute() ? 1 : 0});
    return out;
  }

  // The gradient if no similarity is computed.
  void error_gradient(const Tensor& out) {
    const long count = out.count();
    launch("loss_error_slopes", count, 1, 1, 3, 3,
           {scales_[0].d, pictures_, written(out), count, error_scale(), absolute() ? 1 : 0});
  }

  Context& ctx_;
  const PictureLoss& a_;
  long n_;
  Tensor pictures_, target_;   // what is computed now: all, or a band
  std::vector<Scale> scales_;  // finest first
  Tensor means_, by_;
};

}  // namespace

void picture_loss(Context& ctx, const PictureLoss& a) {
  Dims d;
  d.bind("pictures", a.pictures, {"N", "H", "W", "3"}).bind("target", a.target, {"N", "H", "W", "3"});
  d.bind("out", a.out, {"3"}).bind_optional("dpictures", a.dpictures, {"N", "H", "W", "3"});
  const long least = a.similarity == SimilarityKind::none ? 1 : kLost + 1;
  if (d["N"] < 1 || std::min(d["H"], d["W"]) < least)
    fail(Status::internal, "loss: {} found, at least one picture of {} x {} pixels expected", a.pictures.describe(),
         least, least);
  if (a.pictures.count() > std::numeric_limits<int>::max() - kGroup)
    fail(Status::internal, "loss: {} found, fewer than 2^31 numbers expected", a.pictures.describe());
  Loss(ctx, a, d["N"], d["H"], d["W"]).run();
}

}  // namespace vsplat
