// What kernels are built and launched with where it is a matter of speed: named parameters with their allowed values,
// declared here alone (tuning.cpp), looked up by operation and class of shape through the Context.
//   const TunedValues set = ctx.tuned({TunedOp::gemm, {m, n, k, taps}});
//   ... set.at("tile") ...
// The first allowed value is the default, what is chosen by hand. Results are right with each of them, and with one set
// the same bits each time; which of them is fastest on a device `tune` finds out (model/diagnose/tune/), and keeps in a table.
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
  conv3d_method,    // which of both
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
  std::vector<long> values;  // allowed; the first is the default
};

// Of a shape. Where it is rounded, sizes up to the same power of two are of one class.
struct TunedSize {
  const char* name;
  bool rounded = false;
};

// An operation of one flavour; at the most four sizes, and as many parameters.
struct TunedDeclaration {
  TunedOp op;
  const char* name;
  Flavour flavour;
  std::vector<TunedSize> sizes;
  std::vector<TunedParameter> parameters;
};

const std::vector<TunedDeclaration>& tuned_declarations();
// None where the flavour has nothing to tune in it.
const TunedDeclaration* tuned_declaration(TunedOp op, Flavour flavour);
const TunedDeclaration* tuned_declaration(const std::string& name, Flavour flavour);

// An operation at a size, in the order of its declaration.
struct TunedShape {
  TunedOp op{};
  std::array<long, 4> sizes{};
  auto operator<=>(const TunedShape&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};
// Its class.
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

// What is chosen in place of the defaults.
class Tuning {
 public:
  // What an operation is run with. Without a declaration: nothing to ask for.
  TunedValues values(Flavour flavour, const TunedShape& shape) const;
  // Of that class from now on.
  void set(const TunedShape& shape, const TunedValues& values);
  // Takes out those choices, by their names. Whether the default runs now, of that flavour, in place of one of them.
  bool refuse(Flavour flavour, const std::vector<std::string>& names);
  // Whatever the shape: for trials, and tests.
  void force(TunedOp op, const TunedValues& values);

  // By class.
  const std::map<TunedShape, TunedValues>& chosen() const { return chosen_; }
  // SHA-256 of all that is chosen; empty where nothing is: one hash, one set of bits.
  std::string hash() const;

 private:
  std::map<TunedShape, TunedValues> chosen_;
  std::array<std::optional<TunedValues>, kTunedOps> forced_;
};

// What a table is of: it holds for that device, driver and these kernels alone.
struct TuningSubject {
  std::string device, driver, platform, flavour;
  std::string kernels;  // SHA-256 of the kernels' sources and of the declarations
  bool operator==(const TuningSubject&) const = default;
};
TuningSubject tuning_subject(const DeviceInfo& device, Flavour flavour);

// What came of trying a set of values.
struct TunedTrial {
  TunedShape shape;  // a class
  TunedValues values;
  std::string verdict;  // "default", "best", "slower", "wrong", "failed"; "right": where the default is not, unraced
  double seconds = 0;   // of one run; 0 where it was not timed
  double against = 0;   // what the best so far took beside it
  double error = 0;     // of the largest value; infinite where something was no number
  std::string why;      // of what failed
};

// A table, and how it came about.
struct TuningTable {
  TuningSubject of;
  std::string measured;  // the day
  Tuning choice;
  std::vector<TunedTrial> trials;
};

// Where the table of a device lies: in the cache's folder. Empty where there is no cache.
std::string tuning_path(const TuningSubject& of);
// Error(file) where it cannot be read, Error(format) with path and field where it is no table, or one of values that
// are not declared.
TuningTable read_tuning(const std::string& path);
// Whole or not at all. Error(file).
void write_tuning(const std::string& path, const TuningTable& table);
// A copy of a table that is about to be replaced is kept beside it, by its hash; where that would be.
std::string kept_tuning_path(const std::string& hash);

// What a device's contexts run with: $VSPLAT_TUNING, which is a table's path or "off", else the table in the cache's
// folder, where there is one. Error(usage) where the named one is another device's, driver's or other kernels'; a
// damaged one of the cache is left out, with a warning.
std::shared_ptr<const Tuning> tuning_for(const DeviceInfo& device, Flavour flavour);

}  // namespace vsplat
