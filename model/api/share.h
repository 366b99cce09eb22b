// Devices that share work: of a call's list, or of one device and what its options add.
#pragma once
#include <memory>
#include <vector>

#include "model/api/device.h"

namespace vsplat::api {

// Error(usage) where one is null or comes twice, or there is none.
std::vector<vsplat_device> sharing_devices(const vsplat_device* devices, std::size_t count, const char* what);

// The call's device, and those that its options add to it in the field `what`; none twice.
std::vector<vsplat_device> with_more(vsplat_device device, const vsplat_device* more, std::size_t count,
                                     const char* what);

// "device 1 (NAME)", for the sentences about one of several.
std::string device_text(const std::vector<vsplat_device>& devices, std::size_t index);

// Tells as a warning that a device gets no more work.
void warn_of_loss(const std::vector<vsplat_device>& devices, std::size_t index, const Error& error);

}  // namespace vsplat::api
