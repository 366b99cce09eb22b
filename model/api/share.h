// Devices that share work: a call's list, or one device and those that its options add.
#pragma once
#include <memory>
#include <vector>

#include "model/api/device.h"
#include "runtime/option.h"

namespace vsplat::api {

// Error(usage) if the list is empty, or a device is null or listed twice.
std::vector<vsplat_device> sharing_devices(const vsplat_device* devices, std::size_t count, const char* what);

// The call's device and those that its options add as `what`; none twice.
std::vector<vsplat_device> with_more(vsplat_device device, const vsplat_device* more, std::size_t count, Option what);

// "device 1 (NAME)", for messages about one of several.
std::string device_text(const std::vector<vsplat_device>& devices, std::size_t index);

// Warns that a device gets no more work.
void warn_of_loss(const std::vector<vsplat_device>& devices, std::size_t index, const Error& error);

}  // namespace vsplat::api
