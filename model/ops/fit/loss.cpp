#include "model/ops/fit/loss.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kLost = 10, kGroup = 64, kBlock = 64 * 32;  // as cl/fit/loss.cl: WINDOW - 1, GROUP, GROUP * EACH

struct Scale {
  long height = 0, width = 0;  // of the pictures here
  Tensor m, d, slopes;
  long valid_height() const { return height - kLost; }
  long valid_width() const { return width - kLost; }
};

class Loss {
 public:
  Loss(Context& ctx, const PictureLoss& a, long n, long h, long w) : ctx_(ctx), a_(a), n_(n) {
    scales_.resize(a.similarity == SimilarityKind::automatic && std::min(h, w) > 160 ? 5 : 1);
    for (Scale& s : scales_) {
      s.height = h, s.width = w;
      h = (h + 1) / 2, w = (w + 1) / 2;
    }
    means_ = field({1 + similarities(), 3 * n_}, "loss.means");
    by_ = field({similarities(), 3 * n_}, "loss.by");
  }

  void run() {
    for (std::size_t i = 0; i < scales_.size(); ++i) {
      differences(i);
      if (i == 0) mean(scales_[0].d, scales_[0].height * scales_[0].width, 0, absolute() ? kAbsolute : kSquares);
      if (a_.similarity != SimilarityKind::none) similarity(i);
    }
    ctx_.launch({"loss", "loss_value", ""}, items(1, 1), {}, means_, written(a_.out), written(by_), scales_[0].height,
                scales_[0].width, 3 * n_, similarities(), a_.ssim_weight, a_.gradient_scale);
    if (!a_.dpictures) return;
    if (a_.similarity == SimilarityKind::none) return error_gradient();
    Tensor coarser;
    for (std::size_t i = scales_.size(); i-- > 0;) coarser = gradient(i, coarser);
  }

 private:
  static constexpr int kSums = 0, kSquares = 1, kAbsolute = 2;  // as in the kernel loss_sums

  bool absolute() const { return a_.error == ErrorKind::absolute; }
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
              const std::vector<KernelArg>& args) {
    const double count = static_cast<double>(width) * static_cast<double>(rows) * static_cast<double>(pictures);
    ctx_.launch({"loss", kernel, ""}, groups((width + kGroup - 1) / kGroup, kGroup, rows, pictures),
                {flops * count, 4 * fields * count}, args);
  }

  // The same for kernels that differ between the flavours: on a CPU a work-item processes a whole row.
  void launch_blur(const char* kernel, long width, long rows, long pictures, double flops, double fields,
                   const std::vector<KernelArg>& args) {
    if (ctx_.flavour() != Flavour::cpu) return launch(kernel, width, rows, pictures, flops, fields, args);
    const double count = static_cast<double>(width) * static_cast<double>(rows) * static_cast<double>(pictures);
    ctx_.launch({"loss_cpu", kernel, ""}, items(rows * pictures, 1), {flops * count, 4 * fields * count}, args);
  }

  // m and d of scale i, from the pictures or from the scale before.
  void differences(std::size_t i) {
    Scale& s = scales_[i];
    s.m = field({n_, s.height, s.width, 3}, "loss.m");
    s.d = field({n_, s.height, s.width, 3}, "loss.d");
    if (i == 0) {
      const long count = s.m.count();
      launch("loss_differences", count, 1, 1, 4, 4, {a_.pictures, a_.target, written(s.m), written(s.d), count});
      return;
    }
    const Scale& finer = scales_[i - 1];
    launch("loss_halve", 3 * s.width, s.height, n_, 10, 10,
           {finer.m, finer.d, written(s.m), written(s.d), finer.height, finer.width});
  }

  // The mean dissimilarity at scale i, and its slopes.
  void similarity(std::size_t i) {
    Scale& s = scales_[i];
    const long v3 = 3 * s.valid_width(), rows = n_ * s.height;
    const Tensor blurred = field({4, rows, v3}, "loss.rows");
    launch_blur("loss_rows", v3, rows, 1, 110, 6, {s.m, s.d, written(blurred), v3, rows});
    const Tensor off = field({n_, s.valid_height(), v3}, "loss.off");
    if (a_.dpictures) s.slopes = field({3, n_, s.valid_height(), v3}, "loss.slopes");
    const bool structure = i + 1 < scales_.size();
    launch_blur("loss_maps", v3, s.valid_height(), n_, 130, 8,
                {blurred, written(off), written(s.slopes), v3, s.height, n_, structure ? 1 : 0});
    mean(off, s.valid_height() * s.valid_width(), static_cast<long>(i) + 1, kSums);
  }

  // Row `row` of means_: the mean of x [N, pixels, 3], of its squares or of its absolute values.
  void mean(const Tensor& x, long pixels, long row, int of) {
    const long blocks = (pixels + kBlock - 1) / kBlock;
    const Tensor sums = field({n_, blocks, 3}, "loss.sums");
    const auto count = static_cast<double>(x.count());
    ctx_.launch({"loss", "loss_sums", ""}, groups(blocks, kGroup, n_), {2 * count, 4 * count}, x, written(sums), pixels,
                of);
    ctx_.launch({"loss", "loss_means", ""}, items(3 * n_), {}, sums, written(means_, 3 * n_ * row, 3 * n_), 3 * n_,
                blocks, pixels, 3 * n_ * row);
  }

  Tensor gradient(std::size_t i, const Tensor& coarser) {
    Scale& s = scales_[i];
    const long v3 = 3 * s.valid_width(), padded = v3 + 6 * kLost;
    const Tensor spread = field({3, n_, s.height, padded}, "loss.spread");
    launch_blur("loss_backward_spread", padded, s.height, 3 * n_, 22, 2,
                {s.slopes, written(spread), v3, s.height, 3 * n_});
    const Tensor out = i == 0 ? a_.dpictures : field({n_, s.height, s.width, 3}, "loss.gradient");
    launch_blur("loss_backward", 3 * s.width, s.height, n_, 75, 8,
                {spread, s.m, s.d, by_, coarser, i == 0 ? a_.pictures : Tensor(), written(out), s.height, s.width, n_,
                 3 * n_ * static_cast<long>(i), error_scale(), absolute() ? 1 : 0});
    return out;
  }

  // The gradient if no similarity is computed.
  void error_gradient() {
    const long count = a_.pictures.count();
    launch("loss_error_slopes", count, 1, 1, 3, 3,
           {scales_[0].d, a_.pictures, written(a_.dpictures), count, error_scale(), absolute() ? 1 : 0});
  }

  Context& ctx_;
  const PictureLoss& a_;
  long n_;
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
