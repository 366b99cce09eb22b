// Predicts ray maps from the encoder's features, to replace the cameras' rays if poses are noisy. SHARE's predictor
// after three convolutions: it matches windows of tokens within and across views, and then applies attention between
// all tokens of all views.
#pragma once
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "model/networks/layers/transformer.h"
#include "model/networks/params/config.h"
#include "model/ops/dense/cross_attention.h"

namespace vsplat {

// Attention groups among the t x t tokens of each view: windows, splits x splits of them per view. `across`: tokens
// attend to all other views' tokens, otherwise to those of their own view. Shifted windows join tokens from opposite
// sides of a picture, between which attention is masked. `tiled`: use the tiling of that mask in SHARE's code across
// views.
AttentionGroups match_groups(Context& ctx, long views, long t, long splits, bool shifted, bool across, bool tiled);

class RayPredictor {
 public:
  // Loads "share.*".
  RayPredictor(Context& ctx, const Config& config, const WeightSource& weights);

  struct MatchSaved {
    Tensor x, target;        // [V T, C]: sources of queries, and of keys and values
    Tensor q, k, v;          // [V T, C]
    Tensor attended, stats;  // see model/ops/dense/cross_attention.h
    Tensor merged, message;  // before and after the first norm; the next two only across views:
    Tensor hidden, out;      // in the MLP before GELU, and after it
  };
  // What backward needs from a forward; norms and activations are recomputed.
  struct Saved {
    Shape tokens;
    std::vector<std::array<NormSaved, 3>> reduce;  // one per view
    std::vector<MatchSaved> matching;              // per block, within and then across views
    Tensor matched;                                // [V T, C]
    Tensor before_embedding, codes;                // [V T, C], [V T, view_dim]
    std::vector<BlockSaved> blocks;
    Tensor last;  // [V T, rays], before the final norm
  };
  // Called with results under their golden names ("share.match0"); may be empty.
  using Tap = std::function<void(const std::string&, const Tensor&)>;

  // tokens [V, P + t t, C] of the encoder; V outside 2 to share_max_views is an Error(usage). Returns [V, t, t, 6],
  // direction and moment, not normalised.
  Tensor forward(Context& ctx, const Tensor& tokens, Saved* saved = nullptr, const Tap& tap = {}) const;
  // drays [V, t, t, 6]. Adds to dtokens [V, P + t t, C], unless the configuration detaches, and to the gradients of the
  // weights.
  void backward(Context& ctx, const Saved& saved, const Tensor& drays, const Tensor& dtokens) const;

 private:
  using Matching = RayPredictorLayers<WeightLoader>::Matching;
  // The rows of a view's patches, among the tokens or among the V T rows.
  Tensor rows_of_view(Context& ctx, long view, bool among_tokens) const;
  Tensor reduce(Context& ctx, const Tensor& tokens, Saved* saved) const;
  void reduce_backward(Context& ctx, const Saved& saved, const Tensor& dx, const Tensor& dtokens) const;
  Tensor match(Context& ctx, const Matching& layer, const Tensor& x, const Tensor& target,
               const AttentionGroups& groups, MatchSaved* saved) const;
  // d [V T, C]: gradient by the layer's result on entry, by x on return. Adds to dtarget, which may be d.
  void match_backward(Context& ctx, const Matching& layer, const MatchSaved& saved, const AttentionGroups& groups,
                      const Tensor& d, const Tensor& dtarget) const;
  AttentionGroups groups(Context& ctx, long views, std::size_t block, bool across) const;
  BlockOptions block_options() const { return {config_.share_ray_heads, 1e-6f, Activation::gelu_tanh, {}}; }
  long patches() const { return static_cast<long>(config_.tokens()) * config_.tokens(); }

  Config config_;
  RayPredictorLayers<WeightLoader> layers_;
  Tensor positions_;  // [max_views T, C]: position of a token within its window
  Tensor numbers_;    // [max_views T, rays]: codes of the view and the token
};

}  // namespace vsplat
