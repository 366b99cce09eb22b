// The table of architectures. To add one, write a folder in model/networks/ with its stages, its configuration and
// layers here, a struct like those below, and an entry in the list `Systems`.
#pragma once
#include <string>
#include <variant>
#include <vector>

#include "model/io/archive/torch_file.h"
#include "model/networks/params/config.h"
#include "model/networks/params/deduced_config.h"
#include "model/networks/params/genden_config.h"
#include "model/networks/params/lara_config.h"
#include "model/networks/params/model_of.h"
#include "model/networks/params/vsplat_genden_config.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {

struct VsplatSystem {
  using Config = vsplat::Config;
  static constexpr const char* name = "vsplat";                   // in model files; the default if absent
  static constexpr const char* network = "VS-Splat's network";    // in messages
  static constexpr const char* selects = "voxels";                // what it selects from
  static constexpr const char* mark = "encoder.model.cls_token";  // a tensor that it has, after a checkpoint's prefix
  static constexpr const char* modules[] = {"encoder.", "dir_norm.", "volume_network.", "voxel_network.", "predictor."};
  static const std::vector<std::string>& names() { return config_names(); }
  static Config named(const std::string& config) { return named_config(config); }
  static Config from_json(const std::string& text, const Config& base = {}) { return config_from_json(text, base); }
  static DeducedConfig deduced(const TorchFile& file, const std::string& prefix) {
    return deduced_config(file, prefix);
  }
};

struct LaraSystem {
  using Config = LaraConfig;
  static constexpr const char* name = "lara";
  static constexpr const char* network = "LaRa's network";
  static constexpr const char* selects = "primitives";
  static constexpr const char* mark = "img_encoder.model.cls_token";
  static constexpr const char* modules[] = {"img_encoder.", "dir_norm.", "vol_decoder.", "decoder.", "view_embed"};
  static const std::vector<std::string>& names() { return lara_config_names(); }
  static Config named(const std::string& config) { return named_lara_config(config); }
  static Config from_json(const std::string& text, const Config& base = {}) {
    return lara_config_from_json(text, base);
  }
  static DeducedLaraConfig deduced(const TorchFile& file, const std::string& prefix) {
    return deduced_lara_config(file, prefix);
  }
};

struct GendenSystem {
  using Config = GendenConfig;
  static constexpr const char* name = "genden";
  static constexpr const char* network = "GenDen's network";
  static constexpr const char* selects = "primitives";
  static constexpr const char* mark = "img_encoder.model.cls_token";
  static constexpr const char* modules[] = {"img_encoder.", "dir_norm.",  "vol_decoder.",
                                            "decoder.",     "view_embed", "dec."};
  static const std::vector<std::string>& names() { return genden_config_names(); }
  static Config named(const std::string& config) { return named_genden_config(config); }
  static Config from_json(const std::string& text, const Config& base = {}) {
    return genden_config_from_json(text, base);
  }
  static DeducedGendenConfig deduced(const TorchFile& file, const std::string& prefix) {
    return deduced_genden_config(file, prefix);
  }
};

struct VsplatGendenSystem {
  using Config = VsplatGendenConfig;
  static constexpr const char* name = "vsplat+genden";
  static constexpr const char* network = "VS-Splat's network with GenDen's densifier";
  static constexpr const char* selects = "voxels";
  static constexpr const char* mark = "encoder.model.cls_token";
  static constexpr const char* modules[] = {"encoder.",       "dir_norm.",  "volume_network.",
                                            "voxel_network.", "predictor.", "dec."};
  static const std::vector<std::string>& names() { return vsplat_genden_config_names(); }
  static Config named(const std::string& config) { return named_vsplat_genden_config(config); }
  static Config from_json(const std::string& text, const Config& base = {}) {
    return vsplat_genden_config_from_json(text, base);
  }
  static DeducedVsplatGendenConfig deduced(const TorchFile& file, const std::string& prefix) {
    return deduced_vsplat_genden_config(file, prefix);
  }
};

template <class... All>
struct SystemList {
  using Model = std::variant<ModelOf<typename All::Config>...>;
  using Configuration = std::variant<typename All::Config...>;

  // Calls visit(S()) for the architecture with this name and returns its Result; Error(format) lists the names if there
  // is none.
  template <class Result, class Visit>
  static Result of(const std::string& name, const Visit& visit) {
    Result out{};
    if (!((name == All::name && (out = visit(All()), true)) || ...))
      fail(Status::format, "system is \"{}\"; this vsplat has {}", printable(name), listed());
    return out;
  }
  static std::string listed() {
    std::string out;
    ((out += (out.empty() ? "" : ", ") + std::string(All::name)), ...);
    return out;
  }
};

// The table.
using Systems = SystemList<VsplatSystem, LaraSystem, GendenSystem, VsplatGendenSystem>;

// A model of any architecture.
using AnyModel = Systems::Model;

template <class Config>
struct SystemOf;
template <>
struct SystemOf<Config> : VsplatSystem {};
template <>
struct SystemOf<LaraConfig> : LaraSystem {};
template <>
struct SystemOf<GendenConfig> : GendenSystem {};
template <>
struct SystemOf<VsplatGendenConfig> : VsplatGendenSystem {};

// For example "lara", and "LaRa's network".
inline std::string system_of(const AnyModel& model) {
  return std::visit([](const auto& m) { return std::string(SystemOf<decltype(m.config)>::name); }, model);
}
inline std::string network_of(const AnyModel& model) {
  return std::visit([](const auto& m) { return std::string(SystemOf<decltype(m.config)>::network); }, model);
}

}  // namespace vsplat
