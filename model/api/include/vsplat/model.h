/* Models: a network's weights and configuration. Part of vsplat.h, which states the common conventions. */
#ifndef VSPLAT_MODEL_H
#define VSPLAT_MODEL_H

#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_model_impl* vsplat_model;

typedef struct vsplat_model_options {
  size_t size;
  const char* config;        /* "paper", "small", "tiny" or "micro" */
  const char* const* fields; /* [num_fields] changes to it, "FIELD=VALUE"; may be NULL */
  size_t num_fields;
  uint64_t seed;       /* of the random weights; equal seeds give equal files on every machine */
  const char* encoder; /* a file with DINO ViT weights for the encoder (timm's names; safetensors or torch.save format);
                          NULL: random, like the rest */
  const char* system;  /* architecture: "vsplat", "lara", "genden" or "vsplat+genden"; LaRa and GenDen have "published"
                          in place of "paper"; NULL: "vsplat" */
} vsplat_model_options;
#define VSPLAT_MODEL_OPTIONS_INIT \
  { sizeof(vsplat_model_options), "paper", NULL, 0, 0, NULL, NULL }

/* State of the SHA-256 that a model file states of itself. A wrong hash is VSPLAT_ERROR_FORMAT. */
typedef enum vsplat_hash_state {
  VSPLAT_HASH_ABSENT = 0,   /* the file states none, or the model comes from no file: damaged values are not detected */
  VSPLAT_HASH_VERIFIED = 1, /* stated, and correct */
  VSPLAT_HASH_STATED = 2    /* stated, not checked */
} vsplat_hash_state;

typedef struct vsplat_model_info {
  size_t size;
  int32_t image;          /* the network's pictures are image x image pixels */
  int32_t views;          /* number of views it is trained and evaluated with */
  int32_t max_views;      /* the most views that the network accepts; at least one */
  int32_t volume;         /* voxels along an edge of the cube */
  int32_t sh_degree;      /* of the Gaussians that it makes */
  uint64_t max_gaussians; /* the most it can make, with every voxel selected */
  uint64_t parameters;
  vsplat_hash_state hash;
  int32_t use_views;  /* how many views vsplat_input_prepare picks by default, if there are more */
  int32_t passes;     /* how many passes vsplat_reconstruct runs by default */
  double merge_cell;  /* edge of the cells in which it merges Gaussians by default, in voxels; 0: they stay */
  int32_t fit_epochs; /* how many epochs it fits them to the inputs by default; 0: none */
} vsplat_model_info;
#define VSPLAT_MODEL_INFO_INIT \
  { sizeof(vsplat_model_info), 0, 0, 0, 0, 0, 0, 0, VSPLAT_HASH_ABSENT, 0, 1, 0.0, 0 }

typedef struct vsplat_import_options {
  size_t size;
  const char* config_file;   /* a JSON object with fields of the configuration; NULL: none */
  const char* const* fields; /* [num_fields] changes to it, "FIELD=VALUE"; may be NULL */
  size_t num_fields;
} vsplat_import_options;
#define VSPLAT_IMPORT_OPTIONS_INIT \
  { sizeof(vsplat_import_options), NULL, NULL, 0 }

/* Value type in a model file; the library computes with float32. */
typedef enum vsplat_dtype {
  VSPLAT_DTYPE_F32 = 1,
  VSPLAT_DTYPE_F16 = 2 /* half the size */
} vsplat_dtype;

/* Makes a model with random weights. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_init(const vsplat_model_options* options,
                                                            vsplat_model* out_model);
/* Reads a model file (safetensors): checks its structure, every expected tensor and, if it states one, its hash. `path`
   NULL: the model built into the library; VSPLAT_ERROR_FILE if the library was built without one. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load(const char* path, vsplat_model* out_model);
/* Like vsplat_model_load, from the bytes of a model file. They are only read during the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load_memory(const void* bytes, size_t size,
                                                                   vsplat_model* out_model);
/* Imports a VS-Splat, LaRa or GenDen network from PyTorch: a state dict with the published code's names, with or
   without "net.", bare or in a Lightning checkpoint, in the format of torch.save since PyTorch 1.6. Code in the file is
   never run: content that does not belong to a state dict is refused by its name. Configuration values that the
   tensors' shapes do not determine come from the named configuration that matches all shapes, else from `options`;
   otherwise VSPLAT_ERROR_USAGE names the missing fields. `negate_camera_centre` is true unless `options` says
   otherwise. `out_text`, which may be NULL, becomes a JSON object: "system" ("vsplat", "lara", "genden" or
   "vsplat+genden"), "config" (every field), "named" (the named configuration, or null) and "left_out", a list of the
   file's entries that are not part of the model. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_import(const char* path, const vsplat_import_options* options,
                                                              vsplat_model* out_model, char** out_text);
/* Writes a model file with its hash, whole or not at all; replaces an existing file. Values are float32. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save(vsplat_model model, const char* path);
/* Like vsplat_model_save, with values of type `dtype`. F16 values are rounded to nearest, ties to even;
   VSPLAT_ERROR_INPUT: a value is beyond its range (65504). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save_as(vsplat_model model, const char* path,
                                                               vsplat_dtype dtype);
/* The bytes of that file, `*out_size` of them. They belong to the caller; free them with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save_memory(vsplat_model model, vsplat_dtype dtype,
                                                                   char** out_bytes, size_t* out_size);
/* Returns the same model with another number of views that vsplat_input_prepare picks by default
   (vsplat_model_info.use_views), 1 to max_views. For authors of models, who have measured which number is best. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_with_use_views(vsplat_model model, int32_t use_views,
                                                                      vsplat_model* out_model);
/* Returns the same model with other defaults of vsplat_reconstruct: `passes` is 1 to 16, `merge_cell` 0 to 16,
   `fit_epochs` 0 to 1000. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_with_passes(vsplat_model model, int32_t passes,
                                                                   double merge_cell, int32_t fit_epochs,
                                                                   vsplat_model* out_model);
VSPLAT_API void vsplat_model_retain(vsplat_model model);
VSPLAT_API void vsplat_model_release(vsplat_model model);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_get_info(vsplat_model model, vsplat_model_info* out_info);
/* A model file's header, without reading its values (hash: ABSENT or STATED), also as a JSON object: "config" (every
   field), "tensors", "parameters", "file_bytes", "dtypes", "sha256" and "provenance". Either out_ pointer may be NULL.
   `path` NULL: as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_inspect(const char* path, vsplat_model_info* out_info,
                                                               char** out_text);
/* Reads and checks a whole model file without loading it: structure, shapes, and the hash if one is stated. `path`
   NULL: as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_verify(const char* path, vsplat_hash_state* out_state);

#ifdef __cplusplus
}
#endif

#endif
