// Tuned parameters: parameters of kernels that only affect speed, with their names and allowed values. They are
// declared in one place (tuning.cpp) and looked up through the Context, by operation and class of shape.
//   const TunedValues set = ctx.tuned({TunedOp::gemm, {m, n, k, taps}});
//   ... set.at("tile") ...
// The first allowed value is the default, chosen by hand. Results are correct with every value, and one set of values
// gives the same bits each time. `tune` (model/diagnose/tune/) finds the fastest values for a device and stores them in
// a table.
#pragma once
#include <array>
#include <compare>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace vsplat {

enum class Flavour : int;
struct DeviceInfo;

enum class TunedOp : int {
  gemm,
  gemm_transposed,
  conv3d,           // the direct sum
  conv3d_winograd,  // Winograd's method
  conv3d_method,    // the choice between both
  conv3d_weights,   // the gradient by weights, by the direct sum
  attention_forward,
  attention_backward,
  radix_sort,
  rasterize_forward,
};
constexpr int kTunedOps = 10;

struct TunedParameter {
  const char* name;
  const char* what;
  std::vector<long> values;  // allowed values; the first is the default
};

// A size of a shape. A rounded size belongs to the class of the next power of two.
struct TunedSize {
  const char* name;
  bool rounded = false;
};

// An operation of one flavour, with at most four sizes and four parameters.
struct TunedDeclaration {
  TunedOp op;
  const char* name;
  Flavour flavour;
  std::vector<TunedSize> sizes;
  std::vector<TunedParameter> parameters;
};

const std::vector<TunedDeclaration>& tuned_declarations();
// Null if the flavour has nothing to tune in that operation.
const TunedDeclaration* tuned_declaration(TunedOp op, Flavour flavour);
const TunedDeclaration* tuned_declaration(const std::string& name, Flavour flavour);

// An operation with its sizes, in the order of its declaration.
struct TunedShape {
  TunedOp op{};
  std::array<long, 4> sizes{};
  auto operator<=>(const TunedShape&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};
// The class of a shape.
TunedShape class_of(const TunedDeclaration& of, const TunedShape& shape);
// "gemm m=4096 n=768 k=3072 taps=1"
std::string text_of(const TunedDeclaration& of, const TunedShape& shape);

// A value for each parameter of a declaration.
struct TunedValues {
  const TunedDeclaration* of = nullptr;
  std::array<long, 4> values{};
  long at(const char* name) const;  // Error(internal) for a name that is not declared
  bool operator==(const TunedValues& other) const { return of == other.of && values == other.values; }
};
TunedValues default_values(const TunedDeclaration& of);
// "tile=128 unroll=4"
std::string text_of(const TunedValues& values);
// A choice, with its flavour: "gpu gemm m=4096 n=768 k=3072 taps=1, tile=128 unroll=4".
std::string name_of_choice(const TunedShape& shape, const TunedValues& values);
// All combinations of allowed values, the default first.
std::vector<TunedValues> all_values(const TunedDeclaration& of);

// The shapes that a planner was asked about, by their class: the largest of each, and how often.
struct NotedShape {
  TunedShape largest;
  long calls = 0;
};
using NotedShapes = std::map<TunedShape, NotedShape>;

// Choices that replace the defaults.
class Tuning {
 public:
  // The values that an operation runs with; no values if the flavour has no declaration for it.
  TunedValues values(Flavour flavour, const TunedShape& shape) const;
  // Sets the values of that shape's class.
  void set(const TunedShape& shape, const TunedValues& values);
  // Removes the choices with those names. Returns whether this puts the default in place of one of that flavour.
  bool refuse(Flavour flavour, const std::vector<std::string>& names);
  // Sets the values for all shapes: for trials and tests.
  void force(TunedOp op, const TunedValues& values);

  // By class.
  const std::map<TunedShape, TunedValues>& chosen() const { return chosen_; }
  // SHA-256 of all choices; empty if there are none. Equal hashes mean equal bits in results.
  std::string hash() const;

 private:
  std::map<TunedShape, TunedValues> chosen_;
  std::array<std::optional<TunedValues>, kTunedOps> forced_;
};

// The subject of a table: it is valid only for that device, driver and these kernels.
struct TuningSubject {
  std::string device, driver, platform, flavour;
  std::string kernels;  // SHA-256 of the kernels' sources and of the declarations
  bool operator==(const TuningSubject&) const = default;
};
TuningSubject tuning_subject(const DeviceInfo& device, Flavour flavour);

// The result of trying a set of values.
struct TunedTrial {
  TunedShape shape;  // a class
  TunedValues values;
  std::string verdict;  // "default", "best", "slower", "wrong", "failed"; "right": correct where the default is not,
                        // and not raced
  double seconds = 0;   // of one run; 0 if not timed
  double against = 0;   // seconds of the best values so far, timed beside it
  double error = 0;     // relative to the largest value; infinite if an output was not a finite number
  std::string why;      // why it failed
};

// A table, and how it was made.
struct TuningTable {
  TuningSubject of;
  std::string measured;  // date
  Tuning choice;
  std::vector<TunedTrial> trials;
};

// The file of a device's table, in the cache folder. Empty without a cache.
std::string tuning_path(const TuningSubject& of);
// Error(file) if it cannot be read; Error(format), with path and field, if it is no table or has values that are not
// declared.
TuningTable read_tuning(const std::string& path);
// Writes the whole table or nothing. Error(file).
void write_tuning(const std::string& path, const TuningTable& table);
// Before a table is replaced, a copy of it is stored beside it, named by its hash: the path of that copy.
std::string stored_tuning_path(const std::string& hash);

// The tuning of a device's contexts: $VSPLAT_TUNING, which is a table's path or "off", else the table in the cache
// folder, if there is one. Error(usage) if the named table is for another device, driver or other kernels; a damaged
// table in the cache is ignored, with a warning.
std::shared_ptr<const Tuning> tuning_for(const DeviceInfo& device, Flavour flavour);

}  // namespace vsplat
