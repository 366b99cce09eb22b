#include "model/metrics/lpips_distance.h"

#include <fmt/format.h>

#include <array>
#include <numeric>
#include <optional>
#include <vector>

#include "model/ops/fit/lpips.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/gemm.h"
#include "runtime/printable.h"

namespace vsplat {

struct Lpips::Layer {
  int index;  // of the convolution in torchvision's `features`
  long cin, cout;
  Window2d window;
  std::optional<Window2d> pool_first;  // applied to the convolution's input
  bool compared;                       // its output is one of the five that are compared
};

struct Lpips::Network {
  struct Convolution {
    PackedMatrix weight;
    Tensor bias;
  };
  LpipsNet net;
  std::vector<Layer> layers;
  std::vector<Convolution> convolutions;  // one per layer
  std::vector<Tensor> heads;              // one per compared layer: weights [C] of the features
};

namespace {

constexpr int kCompared = 5;

// Converts pixels in [0,1] to the networks' training normalisation; 3 channels.
std::vector<float> normalised(const Image& image) {
  constexpr std::array<float, 3> shift = {-0.030f, -0.088f, -0.188f}, scale = {0.458f, 0.448f, 0.450f};
  std::vector<float> out(image.data.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = (2 * image.data[i] - 1 - shift[i % 3]) / scale[i % 3];
  return out;
}

// Reorders PyTorch's [Cout, Cin, side, side] to the layout of the map's taps: [Cout, side side, Cin].
std::vector<float> channels_last(const std::vector<float>& w, long cout, long cin, long taps) {
  std::vector<float> out(w.size());
  for (long n = 0; n < cout; ++n)
    for (long c = 0; c < cin; ++c)
      for (long t = 0; t < taps; ++t)
        out[static_cast<std::size_t>((n * taps + t) * cin + c)] = w[static_cast<std::size_t>((n * cin + c) * taps + t)];
  return out;
}

std::vector<float> read(const SafetensorsFile& file, const std::string& name, const Shape& shape) {
  const TensorEntry& entry = file.at(name);
  if (entry.shape != shape)
    fail(Status::format, "{}: tensor {} has shape {}, expected {}", file.path(), name, printable(text_of(entry.shape)),
         text_of(shape));
  return file.floats(entry);
}

}  // namespace

const char* name_of(LpipsNet net) { return net == LpipsNet::alex ? "alex" : "vgg"; }

Lpips::Lpips(Context& ctx, const std::string& path, LpipsNet net) : network_(std::make_unique<Network>()) {
  network_->net = net;
  std::vector<Layer>& layers = network_->layers;
  if (net == LpipsNet::alex) {
    const Window2d pool{3, 2, 0};
    layers = {{0, 3, 64, {11, 4, 2}, std::nullopt, true},
              {3, 64, 192, {5, 1, 2}, pool, true},
              {6, 192, 384, {3, 1, 1}, pool, true},
              {8, 384, 256, {3, 1, 1}, std::nullopt, true},
              {10, 256, 256, {3, 1, 1}, std::nullopt, true}};
  } else {
    long cin = 3;
    int index = 0;  // counts each convolution, its ReLU and each pooling
    const std::pair<long, int> blocks[kCompared] = {{64, 2}, {128, 2}, {256, 3}, {512, 3}, {512, 3}};
    for (const auto& [cout, count] : blocks) {
      for (int i = 0; i < count; ++i, index += 2, cin = cout) {
        const bool pooled = i == 0 && index > 0;
        layers.push_back(
            {index, cin, cout, {3, 1, 1}, pooled ? std::optional(Window2d{2, 2, 0}) : std::nullopt, i + 1 == count});
      }
      ++index;
    }
  }
  const SafetensorsFile file(path);
  for (const Layer& layer : layers) {
    const std::string name = fmt::format("features.{}", layer.index);
    const long side = layer.window.side, k = side * side * layer.cin;
    const std::vector<float> w = channels_last(read(file, name + ".weight", {layer.cout, layer.cin, side, side}),
                                               layer.cout, layer.cin, side * side);
    const std::vector<float> bias = read(file, name + ".bias", {layer.cout});
    network_->convolutions.push_back(
        {pack_matrix(ctx, w.data(), k, layer.cout, 1, k, name, true), ctx.upload({layer.cout}, bias, Type::f32, name)});
    if (!layer.compared) continue;
    const std::string head = fmt::format("lin{}.model.1.weight", network_->heads.size());
    network_->heads.push_back(ctx.upload({layer.cout}, read(file, head, {1, layer.cout, 1, 1}), Type::f32, head));
  }
}

Lpips::~Lpips() = default;
Lpips::Lpips(Lpips&&) noexcept = default;

LpipsNet Lpips::net() const { return network_->net; }

int Lpips::smallest() const {
  for (int side = 1;; ++side) {
    long length = side;
    for (const Layer& layer : network_->layers) {
      if (layer.pool_first) length = layer.pool_first->places(length);
      if (length > 0) length = layer.window.places(length);
      if (length == 0) break;
    }
    if (length > 0) return side;
  }
}

double Lpips::distance(Context& ctx, const Image& a, const Image& b) const {
  if (a.width != b.width || a.height != b.height || a.channels != 3 || b.channels != 3)
    fail(Status::input, "LPIPS: pictures of {} x {} x {} and {} x {} x {} cannot be compared", a.width, a.height,
         a.channels, b.width, b.height, b.channels);
  if (std::min(a.width, a.height) < smallest())
    fail(Status::input, "LPIPS ({}): pictures of {} x {} pixels, at least {} are needed", name_of(network_->net),
         a.width, a.height, smallest());
  const Stage stage(ctx, "lpips");
  std::array<Tensor, 2> features;
  for (int i = 0; i < 2; ++i)
    features[i] = ctx.upload({a.height, a.width, 3}, normalised(i == 0 ? a : b), Type::f32, "picture");

  double total = 0;
  std::size_t head = 0;
  for (std::size_t i = 0; i < network_->layers.size(); ++i) {
    const Layer& layer = network_->layers[i];
    if (layer.pool_first)
      for (Tensor& x : features) x = max_pool(ctx, x, *layer.pool_first);
    const long height = features[0].dim(0), width = features[0].dim(1);
    const Tensor map = picture_map(ctx, height, width, layer.window);
    for (Tensor& x : features) {
      const Tensor out =
          ctx.tensor({layer.window.places(height), layer.window.places(width), layer.cout}, Type::f32, "features");
      Gemm convolution;
      convolution.a.x0 = x;
      convolution.a.map = map;
      convolution.b = &network_->convolutions[i].weight;
      convolution.bias = network_->convolutions[i].bias;
      convolution.out = out;
      convolution.name = "lpips.conv";
      convolution.exact = true;
      gemm(ctx, convolution);
      relu(ctx, out);
      x = out;
    }
    if (!layer.compared) continue;
    const Tensor each = ctx.tensor({features[0].dim(0) * features[0].dim(1)}, Type::f32, "distances");
    feature_distance(ctx, {features[0], features[1], network_->heads[head++], each});
    const std::vector<float> values = ctx.read<float>(each);  // summed here, in double
    total += std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  }
  return total;
}

}  // namespace vsplat
