#include "model/ops/dense/layer_scale.h"

#include "runtime/shape_check.h"

namespace vsplat {

void layer_scale_forward(Context& ctx, const LayerScaleForward& a) {
  Dims d;
  d.bind("weight", a.weight, {"N", "K"}).bind("bias", a.bias, {"N"}).bind("scale", a.scale, {"N"});
  d.bind("out_weight", a.out_weight, {"N", "K"}).bind("out_bias", a.out_bias, {"N"});
  const long n = d["N"], k = d["K"];
  if (n * k == 0) return;
  const double values = static_cast<double>(a.weight.count());
  ctx.launch({"layer_scale", "layer_scale_forward", ""}, groups((k + 63) / 64, 64, n), {values, 8 * values}, a.weight,
             a.bias, a.scale, written(a.out_weight), written(a.out_bias), n, k);
}

void layer_scale_backward(Context& ctx, const LayerScaleBackward& a) {
  Dims d;
  d.bind("weight", a.weight, {"N", "K"}).bind("bias", a.bias, {"N"}).bind("scale", a.scale, {"N"});
  d.bind("dout_weight", a.dout_weight, {"N", "K"}).bind("dout_bias", a.dout_bias, {"N"});
  d.bind("dweight", a.dweight, {"N", "K"}).bind("dbias", a.dbias, {"N"}).bind("dscale", a.dscale, {"N"});
  const long n = d["N"], k = d["K"];
  if (n * k == 0) return;
  const double values = static_cast<double>(a.weight.count());
  ctx.launch({"layer_scale", "layer_scale_backward", ""}, groups(n, 64), {4 * values, 16 * values}, a.weight, a.bias,
             a.scale, a.dout_weight, a.dout_bias, written(a.dweight), written(a.dbias), written(a.dscale), n, k);
}

}  // namespace vsplat
