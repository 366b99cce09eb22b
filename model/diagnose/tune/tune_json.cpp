#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "model/diagnose/tune/search.h"

namespace vsplat {
namespace {

using Json = nlohmann::ordered_json;

Json shape_json(const TunedDeclaration& of, const TunedShape& shape) {
  Json out = Json::object();
  for (std::size_t i = 0; i < of.sizes.size(); ++i) out[of.sizes[i].name] = shape.sizes[i];
  return out;
}

Json values_json(const TunedValues& values) {
  Json out = Json::object();
  for (std::size_t i = 0; i < values.of->parameters.size(); ++i) out[values.of->parameters[i].name] = values.values[i];
  return out;
}

Json line(const TunedTrial& t) {
  return {{"op", t.values.of->name}, {"shape", shape_json(*t.values.of, t.shape)}, {"set", values_json(t.values)}};
}

}  // namespace

std::string tune_json(const Context& ctx, const TuneResult& result) {
  Json out;
  out["device"] = ctx.device().name;
  out["driver"] = ctx.device().driver;
  out["flavour"] = name_of(ctx.flavour());
  out["path"] = result.path;
  out["table"] = result.table.choice.hash();
  out["before"] = result.before;
  out["tried"] = result.tried;
  out["left"] = result.left;
  out["seconds"] = result.seconds;
  out["shapes"] = Json::array();
  for (const TunedShape& shape : result.shapes) {
    const TunedDeclaration& of = *tuned_declaration(shape.op, ctx.flavour());
    out["shapes"].push_back({{"op", of.name}, {"shape", shape_json(of, shape)}});
  }
  out["chosen"] = Json::array();
  out["refused"] = Json::array();
  const auto& trials = result.table.trials;
  for (const auto& [shape, values] : result.table.choice.chosen()) {
    TunedTrial of;
    of.shape = shape, of.values = values;
    Json one = line(of);
    const auto t = std::find_if(trials.begin(), trials.end(), [&](const TunedTrial& trial) {
      return trial.shape == of.shape && trial.values == of.values;
    });
    const bool timed = t != trials.end() && t->seconds > 0;
    one["seconds"] = timed ? Json(t->seconds) : Json();
    one["times_as_fast"] = timed ? Json(t->against / t->seconds) : Json();
    one["error"] = timed ? Json(t->error) : Json();
    out["chosen"].push_back(std::move(one));
  }
  for (const TunedTrial& t : trials) {
    if (t.verdict != "wrong" && t.verdict != "failed") continue;
    Json one = line(t);
    one["verdict"] = t.verdict;
    one["error"] = t.verdict == "wrong" && std::isfinite(t.error) ? Json(t.error) : Json();
    one["why"] = t.why.empty() ? Json() : Json(t.why);
    out["refused"].push_back(std::move(one));
  }
  out["not_right"] = result.not_right;
  return out.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace vsplat
