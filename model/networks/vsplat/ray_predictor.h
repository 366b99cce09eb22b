// What stands for the cameras' rays where poses are noisy: maps of rays, predicted from the encoder's features. SHARE's
// predictor behind three convolutions: windows of tokens are matched within and across views, then all tokens of all
// views look at each other.
#pragma once
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "model/base/camera.h"
#include "model/networks/layers/transformer.h"
#include "model/networks/params/config.h"
#include "model/ops/dense/cross_attention.h"

namespace vsplat {

// Who looks at whom among the t x t tokens of so many views: those of a window of splits x splits. `across`: at those
// of all other views, else at those of the own one. Shifted windows join tokens of a picture's opposite sides, which
// are strangers. `tiled`: which are, is told of the keys across views as SHARE's code tells it.
AttentionGroups match_groups(Context& ctx, long views, long t, long splits, bool shifted, bool across, bool tiled);

// The rays through the centres of a camera's t x t patches: unit direction and moment, [t, t, 6] each camera.
std::vector<float> patch_rays(const std::vector<Camera>& cameras, int t, int patch);

class RayPredictor {
 public:
  // Takes "share.*".
  RayPredictor(Context& ctx, const Config& config, const WeightSource& weights);

  struct MatchSaved {
    Tensor x, target;        // [V T, C]: who looks, and at what
    Tensor q, k, v;          // [V T, C]
    Tensor attended, stats;  // see model/ops/dense/cross_attention.h
    Tensor merged, message;  // before and behind the first norm; across views:
    Tensor hidden, out;      // in the MLP before GELU, and behind it
  };
  // What the backward wants of a forward; norms and activations it makes again.
  struct Saved {
    Shape tokens;
    std::vector<std::array<NormSaved, 3>> reduce;  // of each view
    std::vector<MatchSaved> matching;              // of each block, within and then across views
    Tensor matched;                                // [V T, C]
    Tensor before_embedding, codes;                // [V T, C], [V T, view_dim]
    std::vector<BlockSaved> blocks;
    Tensor last;  // [V T, rays], before the final norm
  };
  // Called with results under their golden names ("share.match0"); may be none.
  using Tap = std::function<void(const std::string&, const Tensor&)>;

  // tokens [V, P + t t, C] of the encoder, V = 2 to share_max_views: Error(usage) -> [V, t, t, 6], direction and
  // moment, of any length.
  Tensor forward(Context& ctx, const Tensor& tokens, Saved* saved = nullptr, const Tap& tap = {}) const;
  // drays [V, t, t, 6]; dtokens [V, P + t t, C] are added to, or nothing where the configuration detaches. Adds to the
  // gradients by the weights.
  void backward(Context& ctx, const Saved& saved, const Tensor& drays, const Tensor& dtokens) const;

 private:
  using Matching = RayPredictorLayers<WeightLoader>::Matching;
  // The rows of a view's patches among the tokens; and among V T rows.
  Tensor rows_of_view(Context& ctx, long view, bool among_tokens) const;
  Tensor reduce(Context& ctx, const Tensor& tokens, Saved* saved) const;
  void reduce_backward(Context& ctx, const Saved& saved, const Tensor& dx, const Tensor& dtokens) const;
  Tensor match(Context& ctx, const Matching& layer, const Tensor& x, const Tensor& target,
               const AttentionGroups& groups, MatchSaved* saved) const;
  // d [V T, C]: by the layer's result before, by x after; dtarget is added to, and may be d.
  void match_backward(Context& ctx, const Matching& layer, const MatchSaved& saved, const AttentionGroups& groups,
                      const Tensor& d, const Tensor& dtarget) const;
  AttentionGroups groups(Context& ctx, long views, std::size_t block, bool across) const;
  BlockOptions block_options() const { return {config_.share_ray_heads, 1e-6f, Activation::gelu_tanh, {}}; }
  long patches() const { return static_cast<long>(config_.tokens()) * config_.tokens(); }

  Config config_;
  RayPredictorLayers<WeightLoader> layers_;
  Tensor positions_;  // [max_views T, C]: a token's place within its window
  Tensor numbers_;    // [max_views T, rays]: of the view and the token
};

}  // namespace vsplat
