// The interface of a network on a device, for reconstruction, evaluation and training. Each architecture has its own
// folder and an implementation of this interface in it.
#pragma once
#include <memory>
#include <utility>
#include <vector>

#include "model/base/camera.h"
#include "model/base/gaussians.h"
#include "model/networks/layers/forward_options.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/any_config.h"
#include "model/render/render.h"
#include "runtime/context.h"

namespace vsplat {

class Network {
 public:
  virtual ~Network() = default;

  // Cameras are in the object's frame. Each architecture uses the ForwardOptions that apply to it: LaRa's and GenDen's
  // networks select the primitives that are not transparent, without noise or temperature; GenDen's takes the seed for
  // the order of its curves.
  virtual const AnyConfig& config() const = 0;
  // Options for rendering its result in that frame, over white.
  virtual RenderOptions drawing() const = 0;

  struct Result {
    DeviceGaussians coarse, final;
    std::vector<int> voxels;  // voxels that are selected or hold a selected primitive, ascending
    int volume = 0;           // voxels along an edge of their grid
    Tensor rays;              // [V, t, t, 6] if poses are predicted
  };
  // Plans and reserves its memory, see VsplatModel::forward().
  virtual Result forward(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                         const ForwardOptions& options) const = 0;
  // Memory that forward needs.
  virtual MemoryPlan plan(const Context& ctx, long views, long selected) const = 0;

  // State of an architecture between the calls of a training step.
  struct State {
    virtual ~State() = default;
  };
  template <typename T>
  struct StateOf : State {
    explicit StateOf(T of) : value(std::move(of)) {}
    T value;
  };
  // The value that this network has stored in the state.
  template <typename T>
  static T& value_in(const std::shared_ptr<State>& state) {
    return dynamic_cast<StateOf<T>&>(*state).value;
  }

  // A training's forward, in two calls, since the second one's memory is known only after the first. Both keep what
  // backward needs, and plan no memory; `ctx` may be a planner.
  struct Half {
    long selected = 0;  // 0 if there is only one level
    std::shared_ptr<State> state;
  };
  struct Trained {
    DeviceGaussians coarse, final;  // `final` is empty if there is one level or ForwardOptions::fine is false
    long selected = 0;
    Tensor rays;                   // as in Result
    std::shared_ptr<State> state;  // backward frees its parts as it uses them
  };
  virtual Half begin(Context& ctx, const Tensor& images, const std::vector<Camera>& cameras,
                     const ForwardOptions& options, bool recompute) const = 0;
  virtual Trained finish(Context& ctx, Half half, const ForwardOptions& options) const = 0;
  // Takes the gradients by both levels (`dfinal` without tensors if there is one) and by predicted rays; adds those by
  // the weights to LearntWeights'. Consumes `dcoarse` and `drays`. `drays` is empty for zeros or if there are no rays.
  virtual void backward(Context& ctx, Trained& trained, const GaussianGradients& dcoarse,
                        const GaussianGradients& dfinal, const Tensor& drays) const = 0;
};

// The part that is the same for every architecture: a model beside its configuration.
template <typename Model, typename Config>
class NetworkWith : public Network {
 public:
  NetworkWith(Context& ctx, const Config& config, const WeightSource& weights)
      : config_(config), model_(ctx, config, weights) {}

  const AnyConfig& config() const override { return config_; }
  RenderOptions drawing() const override { return drawing_of(model_.config()); }
  MemoryPlan plan(const Context& ctx, long views, long selected) const override {
    return model_.plan(ctx, views, selected);
  }

 protected:
  AnyConfig config_;
  Model model_;
};

// Uploads and repacks the weights.
std::unique_ptr<Network> make_network(Context& ctx, const AnyConfig& config, const WeightSource& weights);
// Memory of a model that is not loaded yet, including its weights; allocates nothing.
MemoryPlan plan_network(const Context& ctx, const AnyConfig& config, const Weights& weights, long views, long selected);

// For make_network().
std::unique_ptr<Network> network_of(Context& ctx, const Config& config, const WeightSource& weights);
std::unique_ptr<Network> network_of(Context& ctx, const LaraConfig& config, const WeightSource& weights);
std::unique_ptr<Network> network_of(Context& ctx, const GendenConfig& config, const WeightSource& weights);
std::unique_ptr<Network> network_of(Context& ctx, const VsplatGendenConfig& config, const WeightSource& weights);

}  // namespace vsplat
