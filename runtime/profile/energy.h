// The energy that a run uses, if the machine reports it: the processor's packages through RAPL, NVIDIA's GPUs through
// NVML.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/profile/profile_sums.h"

namespace vsplat {

// An energy counter in joules, which restarts at 0 beyond `range`.
struct EnergySource {
  std::string name;
  double range = 0;                                // 0: it does not restart
  std::function<std::optional<double>()> counter;  // empty if it cannot be read now
};

// The RAPL packages that can be read: FOLDER/intel-rapl:N with name, energy_uj and max_energy_range_uj. On many systems
// only root may read them.
std::vector<EnergySource> rapl_sources(const std::string& folder = "/sys/class/powercap");

// The GPU at that PCI address ("00000000:17:00.0"), if its driver's library is present and reports energy.
std::vector<EnergySource> nvml_sources(const std::string& pci);

// Adds up the energy between start() and stop(), over all such intervals. The sum is right if a counter is sampled more
// often than it restarts.
class EnergyMeter {
 public:
  explicit EnergyMeter(std::vector<EnergySource> sources) : sources_(std::move(sources)), state_(sources_.size()) {}

  void start();
  void sample();  // call regularly in between; reads the counters at most every few seconds
  void stop();
  void sample_now();
  std::vector<Energy> taken() const;  // for the sources that could be read

 private:
  struct State {
    std::optional<double> last;
    double joules = 0;
    bool read = false;
  };
  void add();
  std::vector<EnergySource> sources_;
  std::vector<State> state_;
  std::uint64_t sampled_ns_ = 0;
  bool running_ = false;
};

}  // namespace vsplat
