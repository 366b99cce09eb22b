#include "bench/references.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <memory>

#include "bench/case_data.h"
#include "bench/references_module.h"
#include "runtime/fail.h"
#include "runtime/system/system.h"

namespace vsplat::bench {

std::string beside_bench(const char* file) {
  std::error_code problem;
  const std::filesystem::path program = sys::program_path(problem);
  if (problem) return "";
  const std::filesystem::path folder = program.parent_path(), from_tests = folder / "../model/libexec/vsplat";
  const bool is_test = std::filesystem::exists(from_tests / "vsplat-bench", problem);
  return ((is_test ? from_tests : folder) / file).lexically_normal().string();
}

namespace {

constexpr int kSamples = 300;

std::string module_file() { return beside_bench("vsplat-references.so"); }

class Module {
 public:
  static Module& loaded() {
    static Module module;
    return module;
  }

  bool there() const { return module_ != nullptr; }
  const std::string& why() const { return why_; }
  bool has(const char* name) const { return sys::symbol(module_, name) != nullptr; }  // or what it is linked with
  template <class F>
  F* function(const char* name) const {
    if (void* found = sys::symbol(module_, name)) return reinterpret_cast<F*>(found);
    fail(Status::internal, "{} has no {}: it is not of this version", module_file(), name);
  }

 private:
  Module() {
    const std::string file = module_file();
    if (std::error_code problem; !std::filesystem::exists(file, problem)) {
      why_ =
          "without OpenBLAS and oneDNN: this program was built without them (install libopenblas-dev and "
          "libdnnl-dev, and configure again) or is not where it was built";
      return;
    }
    // What waits for its next turn is not to take a core from whoever has this one.
    sys::set_variable("OMP_WAIT_POLICY", "PASSIVE");
    sys::set_variable("OPENBLAS_THREAD_TIMEOUT", "4");
    std::string said;
    module_ = sys::load_library(file, sys::Symbols::own, said);
    if (!module_)
      why_ = fmt::format("without OpenBLAS and oneDNN: {} cannot be loaded: {}", file, said.empty() ? "?" : said);
  }

  void* module_ = nullptr;
  std::string why_;
};

// Null where there is nothing to compare with: what is no processor is not the host's threads' equal.
Module* module_for(const Context& ctx) {
  if (ctx.device().type != DeviceType::cpu || !Module::loaded().there()) return nullptr;
  Module& module = Module::loaded();
  const auto threads = static_cast<int>(ctx.device().compute_units);
  if (module.has("omp_set_num_threads")) module.function<void(int)>("omp_set_num_threads")(threads);  // oneDNN's
  module.function<void(int)>("vsplat_references_threads")(threads);
  return &module;
}

// A library's task by what makes it, with the data that it points to; no entry where the library is not there.
template <class Task, class Data>
void add(const Module& module, Prepared& to, const char* library, const char* maker, const Task& task,
         const std::shared_ptr<Data>& data, const std::shared_ptr<std::vector<float>>& out,
         const std::function<double(long)>& want) {
  void* made = module.function<void*(const Task*)>(maker)(&task);
  if (!made) {
    const std::string said = module.function<const char*()>("vsplat_reference_trouble")();
    if (!said.empty()) fail(Status::internal, "bench: {} refuses a task: {}", library, said);
    return;
  }
  const std::shared_ptr<void> kept(made, module.function<void(void*)>("vsplat_reference_end"));
  auto* run = module.function<void(void*)>("vsplat_reference_run");
  auto* read = module.function<void(void*)>("vsplat_reference_read");
  to.references[library] = {[run, kept, data, out] { run(kept.get()); },
                            [read, kept, data, out, want] {
                              read(kept.get());
                              return worst_error(
                                  static_cast<long>(out->size()), kSamples,
                                  [&](long i) { return (*out)[static_cast<std::size_t>(i)]; }, want);
                            }};
}

const float* data_or_null(const std::vector<float>& of) { return of.empty() ? nullptr : of.data(); }

std::shared_ptr<std::vector<float>> output_buffer(long count) {
  return std::make_shared<std::vector<float>>(static_cast<std::size_t>(count));
}

}  // namespace

std::string References::about(const Context& ctx) {
  if (ctx.device().type != DeviceType::cpu) return "without OpenBLAS and oneDNN: the device is no processor";
  if (!Module::loaded().there()) return Module::loaded().why();
  return fmt::format("beside {}, {} threads each",
                     Module::loaded().function<const char*()>("vsplat_references_about")(), ctx.device().compute_units);
}

void References::add_product(const Context& ctx, Prepared& to, const std::function<Product()>& make) {
  const Module* module = module_for(ctx);
  if (!module) return;
  const auto data = std::make_shared<Product>(make());
  for (const bool onednn : {false, true}) {
    const auto out = output_buffer(data->m * data->n);
    const VsplatProduct task{data->m,
                             data->n,
                             data->k,
                             data->a.data(),
                             data->w.data(),
                             data_or_null(data->bias),
                             data_or_null(data->residual),
                             static_cast<int>(data->activation),
                             out->data()};
    add(*module, to, onednn ? "onednn" : "openblas", onednn ? "vsplat_onednn_product" : "vsplat_openblas_product", task,
        data, out, onednn ? data->want : data->product);
  }
}

void References::add_convolution(const Context& ctx, Prepared& to, const std::function<Convolution()>& make) {
  const Module* module = module_for(ctx);
  if (!module) return;
  const auto data = std::make_shared<Convolution>(make());
  const auto out = output_buffer(data->side * data->side * data->side * data->cout);
  const VsplatConvolution task{data->side,
                               data->cin,
                               data->cout,
                               data->x.data(),
                               data->w.data(),
                               data->bias.data(),
                               data_or_null(data->residual),
                               out->data()};
  add(*module, to, "onednn", "vsplat_onednn_convolution", task, data, out, data->want);
}

void References::add_attention(const Context& ctx, Prepared& to, const std::function<Attention()>& make) {
  const Module* module = module_for(ctx);
  if (!module) return;
  const auto data = std::make_shared<Attention>(make());
  const auto out = output_buffer(data->v * data->t * data->h * data->d);
  const VsplatAttention task{data->v, data->t, data->h, data->d, data->qkv.data(), out->data()};
  add(*module, to, "onednn", "vsplat_onednn_attention", task, data, out, data->want);
}

}  // namespace vsplat::bench
