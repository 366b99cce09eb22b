// What a run takes of energy, where the machine tells: of the processor's packages by RAPL, of NVIDIA's GPUs by NVML.
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/profile/profile_sums.h"

namespace vsplat {

// A counter of energy that begins anew beyond `range`, in joules.
struct EnergySource {
  std::string name;
  double range = 0;                                // 0: it does not
  std::function<std::optional<double>()> counter;  // nothing where it cannot be read now
};

// The packages of RAPL that can be read: FOLDER/intel-rapl:N with name, energy_uj and max_energy_range_uj. Many systems
// let root alone read them.
std::vector<EnergySource> rapl_sources(const std::string& folder = "/sys/class/powercap");

// The GPU at that place of the PCI bus ("00000000:17:00.0"), where its driver's library is there and tells.
std::vector<EnergySource> nvml_sources(const std::string& pci);

// Adds up what its sources count between start() and stop(), over all such times. What is sampled more often than a
// counter begins anew is right.
class EnergyMeter {
 public:
  explicit EnergyMeter(std::vector<EnergySource> sources) : sources_(std::move(sources)), state_(sources_.size()) {}

  void start();
  void sample();  // now and then in between; reads no more than every few seconds
  void stop();
  void sample_now();
  std::vector<Energy> taken() const;  // of sources that could be read

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
