// All that is OpenBLAS's and oneDNN's: a module that bench/references.cpp loads. Weights are brought to the layout that
// oneDNN chooses before anything is timed, as ours are packed before; so are a convolution's volumes.
#include "bench/references_module.h"

#include <cmath>
#include <exception>
#include <functional>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#ifdef VSPLAT_WITH_OPENBLAS
#include <cblas.h>
#endif
#ifdef VSPLAT_WITH_DNNL
#include <dnnl.hpp>
#endif

#define EXPORTED extern "C" __attribute__((visibility("default")))

namespace {

struct Task {
  std::function<void()> run, read;
};

std::string trouble;

// A task, or null and what was wrong.
void* made(const std::function<Task()>& make) {
  try {
    return new Task(make());
  } catch (const std::exception& e) {
    trouble = e.what();
    return nullptr;
  }
}

#ifdef VSPLAT_WITH_DNNL
using dnnl::memory;
using Dims = memory::dims;

// One primitive after the other, on the host's memory.
struct OneDnn {
  dnnl::engine engine{dnnl::engine::kind::cpu, 0};
  dnnl::stream stream{engine};
  std::vector<std::pair<dnnl::primitive, std::unordered_map<int, memory>>> steps;

  memory lying(const Dims& dims, const Dims& strides, const float* at) const {
    return {memory::desc(dims, memory::data_type::f32, strides), engine, const_cast<float*>(at)};
  }
  memory like(const memory::desc& desc) const { return {desc, engine}; }
  static memory::desc any(const Dims& dims) { return {dims, memory::data_type::f32, memory::format_tag::any}; }
  void reorder(memory from, memory to) {
    dnnl::reorder(from, to).execute(stream, from, to);
    stream.wait();
  }
  memory brought(const memory& from, const memory::desc& desc) {
    memory to = like(desc);
    reorder(from, to);
    return to;
  }
  void run() {
    for (auto& [primitive, arguments] : steps) primitive.execute(stream, arguments);
    stream.wait();
  }
};

// What versions 2 (Debian 12) and 3 (Debian 13) spell differently: version 3 passes an operation's arguments to its
// primitive_desc without a description between them, and its element-wise operations have no scale.
#if DNNL_VERSION_MAJOR >= 3
using Softmax = dnnl::softmax_forward;
#else
using Softmax = dnnl::softmax_v2_forward;
#endif
template <class Primitive, class... Arguments>
typename Primitive::primitive_desc described(const dnnl::engine& engine, const dnnl::primitive_attr& attributes,
                                             const Arguments&... arguments) {
#if DNNL_VERSION_MAJOR >= 3
  return {engine, arguments..., attributes};
#else
  return {typename Primitive::desc(arguments...), attributes, engine};
#endif
}
void append_eltwise(dnnl::post_ops& ops, dnnl::algorithm what, float alpha) {
#if DNNL_VERSION_MAJOR >= 3
  ops.append_eltwise(what, alpha, 0.0f);
#else
  ops.append_eltwise(1.0f, what, alpha, 0.0f);
#endif
}

void append_activation(dnnl::post_ops& ops, int activation) {
  if (activation == 1) append_eltwise(ops, dnnl::algorithm::eltwise_gelu_erf, 0.0f);
  if (activation == 2) append_eltwise(ops, dnnl::algorithm::eltwise_swish, 1.0f);
}

Task onednn_product(const VsplatProduct& p) {
  const auto d = std::make_shared<OneDnn>();
  const memory a = d->lying({p.m, p.k}, {p.k, 1}, p.a), w = d->lying({p.k, p.n}, {1, p.k}, p.w),
               out = d->lying({p.m, p.n}, {p.n, 1}, p.out);
  dnnl::post_ops ops;
  append_activation(ops, p.activation);
  if (p.residual) ops.append_binary(dnnl::algorithm::binary_add, out.get_desc());
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(ops);
  const memory bias = p.bias ? d->lying({1, p.n}, {p.n, 1}, p.bias) : memory();
  const memory::desc weights = OneDnn::any({p.k, p.n});
  const auto desc =
      p.bias ? described<dnnl::matmul>(d->engine, attributes, a.get_desc(), weights, bias.get_desc(), out.get_desc())
             : described<dnnl::matmul>(d->engine, attributes, a.get_desc(), weights, out.get_desc());
  // By way of rows: oneDNN 3.7.2 brings columns wrongly to its blocks where those are larger than the matrix.
  const memory rows = d->brought(w, {{p.k, p.n}, memory::data_type::f32, memory::format_tag::ab});
  std::unordered_map<int, memory> arguments = {
      {DNNL_ARG_SRC, a}, {DNNL_ARG_WEIGHTS, d->brought(rows, desc.weights_desc())}, {DNNL_ARG_DST, out}};
  if (p.bias) arguments[DNNL_ARG_BIAS] = bias;
  if (p.residual)
    arguments[DNNL_ARG_ATTR_MULTIPLE_POST_OP(ops.len() - 1) | DNNL_ARG_SRC_1] =
        d->lying({p.m, p.n}, {p.n, 1}, p.residual);
  d->steps = {{dnnl::matmul(desc), arguments}};
  return {[d] { d->run(); }, [] {}};
}

Task onednn_convolution(const VsplatConvolution& c) {
  const auto d = std::make_shared<OneDnn>();
  const long s = c.side;
  const auto volume = [&](long channels, const float* at) {
    return d->lying({1, channels, s, s, s}, {s * s * s * channels, 1, s * s * channels, s * channels, channels}, at);
  };
  const memory x = volume(c.cin, c.x), out = volume(c.cout, c.out),
               w = d->lying({c.cout, c.cin, 3, 3, 3}, {c.cin * 27, 27, 9, 3, 1}, c.w),
               bias = d->lying({c.cout}, {1}, c.bias);
  dnnl::post_ops ops;
  if (c.residual) ops.append_binary(dnnl::algorithm::binary_add, OneDnn::any({1, c.cout, s, s, s}));
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(ops);
  const auto any = [&](long channels) { return OneDnn::any({1, channels, s, s, s}); };
  const auto between = [&](const memory::desc& from, const memory::desc& to, const dnnl::primitive_attr& with) {
    const Dims ones = {1, 1, 1};  // strides, and padding at either end
    return described<dnnl::convolution_forward>(
        d->engine, with, dnnl::prop_kind::forward_inference, dnnl::algorithm::convolution_auto, from,
        OneDnn::any({c.cout, c.cin, 3, 3, 3}), bias.get_desc(), to, ones, ones, ones);
  };
  // The layouts that it chooses without a residual, which then lies as the result does.
  const auto plain = between(any(c.cin), any(c.cout), {});
  if (c.residual) {
    dnnl::post_ops adding;
    adding.append_binary(dnnl::algorithm::binary_add, plain.dst_desc());
    attributes.set_post_ops(adding);
  }
  const auto desc = between(plain.src_desc(), plain.dst_desc(), attributes);
  const memory result = d->like(desc.dst_desc());
  std::unordered_map<int, memory> arguments = {{DNNL_ARG_SRC, d->brought(x, desc.src_desc())},
                                               {DNNL_ARG_WEIGHTS, d->brought(w, desc.weights_desc())},
                                               {DNNL_ARG_BIAS, bias},
                                               {DNNL_ARG_DST, result}};
  if (c.residual)
    arguments[DNNL_ARG_ATTR_MULTIPLE_POST_OP(0) | DNNL_ARG_SRC_1] =
        d->brought(volume(c.cout, c.residual), desc.dst_desc());
  d->steps = {{dnnl::convolution_forward(desc), arguments}};
  return {[d] { d->run(); }, [d, result, out] { d->reorder(result, out); }};
}

// As whoever has no attention of its own does it: all weights in memory, by a product, a softmax and a product.
Task onednn_attention(const VsplatAttention& a) {
  const auto d = std::make_shared<OneDnn>();
  const long row = 3 * a.h * a.d;
  const auto part = [&](long which) {
    return d->lying({a.v, a.h, a.t, a.d}, {a.t * row, a.d, row, 1}, a.qkv + which * a.h * a.d);
  };
  const memory q = part(0), v = part(2),
               k = d->lying({a.v, a.h, a.d, a.t}, {a.t * row, a.d, 1, row}, a.qkv + a.h * a.d),
               out = d->lying({a.v, a.h, a.t, a.d}, {a.t * a.h * a.d, a.d, a.h * a.d, 1}, a.out),
               scores = d->like({{a.v, a.h, a.t, a.t}, memory::data_type::f32, memory::format_tag::abcd});
  dnnl::post_ops scale;
  append_eltwise(scale, dnnl::algorithm::eltwise_linear, static_cast<float>(1 / std::sqrt(static_cast<double>(a.d))));
  dnnl::primitive_attr scaled;
  scaled.set_post_ops(scale);
  const auto first = described<dnnl::matmul>(d->engine, scaled, q.get_desc(), k.get_desc(), scores.get_desc());
  const auto softmax = described<Softmax>(d->engine, {}, dnnl::prop_kind::forward_inference,
                                          dnnl::algorithm::softmax_accurate, scores.get_desc(), scores.get_desc(), 3);
  const auto second = described<dnnl::matmul>(d->engine, {}, scores.get_desc(), v.get_desc(), out.get_desc());
  d->steps = {{dnnl::matmul(first), {{DNNL_ARG_SRC, q}, {DNNL_ARG_WEIGHTS, k}, {DNNL_ARG_DST, scores}}},
              {Softmax(softmax), {{DNNL_ARG_SRC, scores}, {DNNL_ARG_DST, scores}}},
              {dnnl::matmul(second), {{DNNL_ARG_SRC, scores}, {DNNL_ARG_WEIGHTS, v}, {DNNL_ARG_DST, out}}}};
  return {[d] { d->run(); }, [] {}};
}
#endif

}  // namespace

EXPORTED const char* vsplat_references_about() {
  static const std::string text = [] {
    std::string out;
#ifdef VSPLAT_WITH_OPENBLAS
    const std::string config = openblas_get_config();  // "OpenBLAS 0.3.21 NO_LAPACKE ... SkylakeX MAX_THREADS=64"
    out += config.substr(0, config.find(' ', config.find(' ') + 1));
#endif
#ifdef VSPLAT_WITH_DNNL
    const dnnl_version_t& v = *dnnl_version();
    out += (out.empty() ? "" : ", ") + ("oneDNN " + std::to_string(v.major)) + "." + std::to_string(v.minor) + "." +
           std::to_string(v.patch);
#endif
    return out;
  }();
  return text.c_str();
}

EXPORTED void vsplat_references_threads([[maybe_unused]] int count) {
#ifdef VSPLAT_WITH_OPENBLAS
  openblas_set_num_threads(count);
#endif
}

EXPORTED void* vsplat_openblas_product([[maybe_unused]] const VsplatProduct* task) {
#ifdef VSPLAT_WITH_OPENBLAS
  return made([&] {
    return Task{[p = *task] {
                  cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasTrans, static_cast<int>(p.m), static_cast<int>(p.n),
                              static_cast<int>(p.k), 1.0f, p.a, static_cast<int>(p.k), p.w, static_cast<int>(p.k), 0.0f,
                              p.out, static_cast<int>(p.n));
                },
                [] {}};
  });
#else
  trouble.clear();
  return nullptr;
#endif
}

#ifdef VSPLAT_WITH_DNNL
EXPORTED void* vsplat_onednn_product(const VsplatProduct* task) {
  return made([&] { return onednn_product(*task); });
}
EXPORTED void* vsplat_onednn_convolution(const VsplatConvolution* task) {
  return made([&] { return onednn_convolution(*task); });
}
EXPORTED void* vsplat_onednn_attention(const VsplatAttention* task) {
  return made([&] { return onednn_attention(*task); });
}
#else
EXPORTED void* vsplat_onednn_product(const VsplatProduct*) { return trouble.clear(), nullptr; }
EXPORTED void* vsplat_onednn_convolution(const VsplatConvolution*) { return trouble.clear(), nullptr; }
EXPORTED void* vsplat_onednn_attention(const VsplatAttention*) { return trouble.clear(), nullptr; }
#endif

EXPORTED const char* vsplat_reference_trouble() { return trouble.c_str(); }
EXPORTED void vsplat_reference_run(void* task) { static_cast<Task*>(task)->run(); }
EXPORTED void vsplat_reference_read(void* task) { static_cast<Task*>(task)->read(); }
EXPORTED void vsplat_reference_end(void* task) { delete static_cast<Task*>(task); }
