// A configuration of any architecture in systems.h, and the queries that jobs need.
#pragma once
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "model/base/taken_views.h"
#include "model/networks/params/parameter.h"
#include "model/networks/params/systems.h"

namespace vsplat {

class AnyConfig {
 public:
  template <class C, class = std::enable_if_t<std::is_constructible_v<Systems::Configuration, C>>>
  AnyConfig(C config) : of_(std::move(config)) {}  // NOLINT(google-explicit-constructor): each is one

  // visit(config) with the architecture's own type.
  template <class Visit>
  auto visit(const Visit& visit) const {
    return std::visit(visit, of_);
  }
  // Null if it belongs to another architecture.
  template <class C>
  const C* get_if() const {
    return std::get_if<C>(&of_);
  }

  // The same, but also for architectures built on C's, like VS-Splat's network with the densifier.
  template <class C>
  const C* as() const {
    return visit([](const auto& own) -> const C* {
      if constexpr (std::is_base_of_v<C, std::decay_t<decltype(own)>>)
        return &own;
      else
        return nullptr;
    });
  }

  std::string system() const;   // "lara"
  std::string network() const;  // "LaRa's network"
  TakenViews taken() const;
  int image() const { return taken().image; }
  // Number of candidates that the network selects from: voxels, or primitives. noise(): how many of them may have noise
  // in a training.
  long selectable() const;
  long noise() const;
  const char* selects() const;  // "voxels", "primitives"
  bool has_fine() const;        // whether there is a second level
  bool has_surfels() const;

  bool operator==(const AnyConfig&) const = default;

 private:
  Systems::Configuration of_;
};

std::vector<Parameter> parameters(const AnyConfig& config);
long parameter_count(const AnyConfig& config);  // of trained values
void check(const AnyConfig& config, Status status = Status::usage);

// A named configuration of an architecture. Error(usage) lists the architectures, or the names.
AnyConfig named_any_config(const std::string& system, const std::string& name);
// The fields, after "system", which VS-Splat's configuration omits.
std::string any_to_json(const AnyConfig& config);
// Absent fields come from the architecture's configuration `base`; without "system", it is VS-Splat's.
AnyConfig any_config_from_json(const std::string& text, const std::string& base);
AnyConfig with_fields(AnyConfig config, const std::vector<std::string>& assignments);

}  // namespace vsplat
