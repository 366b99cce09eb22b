/* A report of a machine for an issue, in one text. Part of vsplat.h, which states the common conventions. */
#ifndef VSPLAT_REPORT_H
#define VSPLAT_REPORT_H

#include <vsplat/device.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_report_options {
  size_t size;
  double seconds;                    /* time limit for one driver, as in vsplat_doctor_options */
  vsplat_progress_function progress; /* of the run; may be NULL */
  void* user;
} vsplat_report_options;
#define VSPLAT_REPORT_OPTIONS_INIT \
  { sizeof(vsplat_report_options), 20, NULL, NULL }

/* Collects what helps to find out what is wrong on a machine. `device` may be NULL: then this process calls no OpenCL,
   and "device" and "run" are null. With a device, the report includes a standard run: the built-in model reconstructs
   and draws a built-in object (vsplat_model_check), with a profile; if that fails, the report has the error. Home
   folders are replaced by ~; the names of users and of the machine in variables, paths and messages by USER and HOST.
   `options` NULL: defaults. `out_text` becomes JSON, to be freed with vsplat_text_free: {"format": "vsplat-report",
   "version", "made": the day, "system", "environment", "doctor": the result of vsplat_doctor, "kept": [{"file",
   "content", "bytes"}], the tables, verdicts and measured peaks in the cache folder, "device": {"index", "name",
   "driver", "kernels", "tuning", "limits", "switched_off", ...}, "run": {"check", "profile", "error"}}. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_report(vsplat_device device, const vsplat_report_options* options,
                                                        char** out_text);

#ifdef __cplusplus
}
#endif

#endif
