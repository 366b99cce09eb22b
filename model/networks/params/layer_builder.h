// Layers in the declaration of a network. A declaration gives a name and sizes; this class derives the layer's
// parameters, their shapes, initial values and weight decay. `Make` decides what the result is: an entry in the list of
// parameters (params.cpp), or a layer on the device (model/networks/layers/upload_weights.h).
#pragma once
#include <string>
#include <utility>

#include "model/networks/params/parameter.h"

namespace vsplat {

// "<name>.weight" and "<name>.bias"; the bias has no name if the layer has none.
struct LayerParameters {
  std::string name;
  Parameter weight, bias;
};

template <class Make>
class LayerBuilder {
 public:
  using Linear = typename Make::Linear;
  using Conv = typename Make::Conv;

  explicit LayerBuilder(Make make) : make_(std::move(make)) {}

  // For the layers under "<name>.".
  LayerBuilder in(const std::string& name) const {
    LayerBuilder out = *this;
    out.prefix_ += name + ".";
    return out;
  }
  // For layers that affect the result only if `used`.
  LayerBuilder used_if(bool used) const {
    LayerBuilder out = *this;
    out.used_ = used;
    return out;
  }

  // For layers that are initialised like heads.
  LayerBuilder like_heads() const {
    LayerBuilder out = *this;
    out.like_heads_ = true;
    return out;
  }

  // A tensor that is stored but not trained.
  typename Make::Fixed fixed(const std::string& name, Shape shape, Init init) const {
    Parameter p = parameter(name, std::move(shape), init);
    p.trained = false;
    return make_.fixed(p);
  }
  // A tensor that is trained as it is; starts normal with variance 1/width.
  typename Make::Learnt learnt(const std::string& name, Shape shape, long width) const {
    Parameter p = parameter(name, std::move(shape), Init::normal);
    p.fan_in = width;
    return make_.learnt(p);
  }
  // Embeddings added to tokens: a class token, and position embeddings stored for a grid of `from` x `from` tokens (and
  // for the class token), to be resampled to `to` x `to`.
  typename Make::Positions positions(const std::string& class_token, const std::string& name, int from, int to,
                                     long dim) const {
    return make_.positions(parameter(class_token, {1, 1, dim}, Init::zeros),
                           parameter(name, {1, static_cast<long>(from) * from + 1, dim}, Init::position), from, to);
  }

  // Learnt tokens, like a class token: [1, count, dim].
  typename Make::Learnt tokens(const std::string& name, long count, long dim) const {
    return make_.learnt(parameter(name, {1, count, dim}, Init::position));
  }
  // A learnt vector that is added to `size` channels, and one that they are multiplied by.
  typename Make::Learnt bias(const std::string& name, long size) const {
    Parameter p = parameter(name, {size}, Init::zeros);
    p.decays = false;
    return make_.learnt(p);
  }
  typename Make::Learnt scale(const std::string& name, long size) const {
    return make_.learnt(parameter(name, {size}, Init::layer_scale));
  }

  Linear linear(const std::string& name, long in, long out) const { return make_.linear(dense(name, {out, in})); }
  Linear linear_unbiased(const std::string& name, long in, long out) const {
    LayerParameters p = dense(name, {out, in});
    p.bias = {};
    return make_.linear(p);
  }
  // A Linear whose outputs are multiplied by `scale`, unless that is null.
  typename Make::ScaledLinear scaled_linear(const std::string& name, long in, long out,
                                            const typename Make::Learnt* scale) const {
    return make_.scaled_linear(dense(name, {out, in}), scale);
  }
  // A Linear without a bias, whose weight is called just `name`.
  Linear matrix(const std::string& name, long in, long out) const {
    LayerParameters p{prefix_ + name, parameter(name, {out, in}, Init::xavier), {}};
    p.weight.fan_in = in;
    p.weight.fan_out = out;
    return make_.linear(p);
  }
  // A Linear of a head, initialised as such.
  Linear head(const std::string& name, long in, long out) const {
    LayerParameters p = layer(name, {out, in}, Init::xavier, Init::zeros);
    p.weight.fan_in = in;
    p.weight.fan_out = out;
    return make_.linear(p);
  }
  // A 1x1 convolution of pictures.
  Linear pixelwise(const std::string& name, long in, long out) const {
    return make_.linear(dense(name, {out, in, 1, 1}));
  }
  // A 1x1x1 convolution.
  Linear pointwise(const std::string& name, long in, long out) const {
    return make_.linear(dense(name, {out, in, 1, 1, 1}));
  }
  // One that is applied separately to the first `first` input channels and to the rest.
  typename Make::SplitLinear split_pointwise(const std::string& name, long first, long rest, long out) const {
    return make_.split_linear(dense(name, {out, first + rest, 1, 1, 1}), first);
  }
  // A convolution of pictures with a stride equal to its size.
  Linear patches(const std::string& name, long in, long out, long size) const {
    return make_.linear(dense(name, {out, in, size, size}));
  }

  // 3x3x3; 2x2x2 with stride 2; and, over active voxels only, kernel^3 taps.
  Conv conv3d(const std::string& name, long in, long out) const {
    return make_.conv3d(dense(name, {out, in, 3, 3, 3}));
  }
  Conv conv3d_unbiased(const std::string& name, long in, long out) const {
    LayerParameters p = dense(name, {out, in, 3, 3, 3});
    p.bias = {};
    return make_.conv3d(p);
  }
  Conv conv3d_down(const std::string& name, long in, long out) const {
    return make_.conv3d_down(dense(name, {out, in, 2, 2, 2}));
  }
  // Transposed 2x2x2 with stride 2. Its weight is [in, out, ..]; PyTorch uses its second size as the number of inputs.
  typename Make::ConvUp conv3d_up(const std::string& name, long in, long out) const {
    LayerParameters p{prefix_ + name, parameter(name + ".weight", {in, out, 2, 2, 2}, Init::fan_in),
                      parameter(name + ".bias", {out}, Init::fan_in)};
    p.weight.fan_in = p.bias.fan_in = 8 * out;
    p.bias.decays = false;
    return make_.conv3d_up(p);
  }
  Conv submanifold(const std::string& name, long in, long out, long kernel) const {
    LayerParameters p = layer(name, {out, kernel, kernel, kernel, in}, Init::submanifold, Init::zeros);
    p.weight.fan_in = in * kernel * kernel * kernel;
    return make_.submanifold(p);
  }

  typename Make::LayerNorm layer_norm(const std::string& name, long channels) const {
    LayerParameters p = layer(name, {channels}, Init::ones, Init::zeros);
    p.weight.decays = false;
    return make_.layer_norm(p);
  }
  typename Make::GroupNorm group_norm(const std::string& name, long channels, int groups) const {
    return make_.group_norm(layer(name, {channels}, Init::ones, Init::zeros), groups);
  }

  // Three linear layers with SiLU between them.
  typename Make::Mlp3 mlp3(const std::string& name, long in, long out) const {
    return {head(name + ".0", in, in), head(name + ".2", in, in), head(name + ".4", in, out)};
  }

 private:
  Parameter parameter(const std::string& name, Shape shape, Init init) const {
    Parameter p;
    p.name = prefix_ + name;
    p.shape = std::move(shape);
    p.init = init;
    p.used = used_;
    return p;
  }
  // The weight is [out, ...], with one bias for each of `out`.
  LayerParameters layer(const std::string& name, Shape shape, Init weight, Init bias) const {
    const long out = shape.at(0);
    LayerParameters p{prefix_ + name, parameter(name + ".weight", std::move(shape), weight),
                      parameter(name + ".bias", {out}, bias)};
    p.bias.decays = false;
    return p;
  }
  // All sizes of the shape but the first feed one output.
  LayerParameters dense(const std::string& name, Shape shape) const {
    LayerParameters p = layer(name, std::move(shape), Init::fan_in, Init::fan_in);
    p.weight.fan_in = p.bias.fan_in = p.weight.count() / p.weight.shape.at(0);
    if (like_heads_) p.weight.init = Init::xavier, p.weight.fan_out = p.weight.shape.at(0), p.bias.init = Init::zeros;
    return p;
  }

  Make make_;
  std::string prefix_;
  bool used_ = true, like_heads_ = false;
};

}  // namespace vsplat
