// Scopes of a context: a named stage, and work that is not cancelled.
#pragma once
#include <optional>
#include <string>

#include "runtime/host_span.h"

namespace vsplat {

class Context;

// Names the stage of all launches during its life: "encoder", "modulation", "lifting", "volume", "heads", "selection",
// "refinement", "decode", "splat", and within it "project", "sort", "rasterize". The innermost one counts. Memory peaks
// are recorded per stage, too.
class Stage {
 public:
  Stage(Context& context, const std::string& name);
  ~Stage();
  Stage(const Stage&) = delete;
  Stage& operator=(const Stage&) = delete;

 private:
  Context& context_;
  std::string before_, before_of_host_;
  std::optional<HostSpan> span_;
};

// While this object lives, nothing is cancelled: for changes that must be complete or not happen at all.
class Uncancelled {
 public:
  explicit Uncancelled(Context& context);
  ~Uncancelled();
  Uncancelled(const Uncancelled&) = delete;
  Uncancelled& operator=(const Uncancelled&) = delete;

 private:
  Context& context_;
};

}  // namespace vsplat
