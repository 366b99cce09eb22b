// The networks whose weights are on a device, for all of its streams.
#pragma once
#include <memory>
#include <mutex>
#include <vector>

#include "model/api/model.h"
#include "model/networks/network.h"
#include "runtime/context.h"

namespace vsplat::api {

// Thread-safe. A network stays until its model goes, or until others' memory is wanted.
class Residents {
 public:
  // The model's. Uploaded and repacked with `ctx`, a context of the device, where it is not there yet: whoever asks for
  // it meanwhile waits. Where memory is short, without the networks that no call uses.
  std::shared_ptr<const Network> network(Context& ctx, vsplat_model model);
  // Drops what no call uses, but for that model's; whether there was any.
  bool drop_idle(vsplat_model but = nullptr);

 private:
  struct Resident {
    std::weak_ptr<const AnyModel> model;
    std::shared_ptr<const Network> network;
  };
  bool drop(const AnyModel* but);

  std::mutex mutex_;
  std::vector<Resident> all_;
};

}  // namespace vsplat::api
