/* Models: a network's weights and configuration.
   Part of vsplat.h, which says what holds for all of it. */
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
  const char* const* fields; /* [num_fields] "FIELD=VALUE" changes to it; may be NULL */
  size_t num_fields;
  uint64_t seed;       /* of the random weights: the same file everywhere */
  const char* encoder; /* a file with DINO ViT weights (timm's names; safetensors, or of torch.save) for the encoder;
                          NULL: random, too */
  const char* system;  /* whose network: "vsplat", "lara", "genden" or "vsplat+genden"; LaRa's and GenDen's have
                          "published" for "paper"; NULL: "vsplat" */
} vsplat_model_options;
#define VSPLAT_MODEL_OPTIONS_INIT \
  { sizeof(vsplat_model_options), "paper", NULL, 0, 0, NULL, NULL }

/* Of the SHA-256 that a model file states of itself. A wrong one is VSPLAT_ERROR_FORMAT. */
typedef enum vsplat_hash_state {
  VSPLAT_HASH_ABSENT = 0,   /* the file states none (or the model comes from no file): damage to values goes unseen */
  VSPLAT_HASH_VERIFIED = 1, /* stated, and right */
  VSPLAT_HASH_STATED = 2    /* stated, not compared */
} vsplat_hash_state;

typedef struct vsplat_model_info {
  size_t size;
  int32_t image;          /* the network's pictures are image x image pixels */
  int32_t views;          /* how many views it is trained and measured with */
  int32_t max_views;      /* most that the network takes; at least one */
  int32_t volume;         /* voxels along an edge of the cube */
  int32_t sh_degree;      /* of the Gaussians it makes */
  uint64_t max_gaussians; /* that it can make, every voxel selected */
  uint64_t parameters;
  vsplat_hash_state hash;
  int32_t use_views; /* how many views vsplat_input_prepare picks by default, where there are more */
} vsplat_model_info;
#define VSPLAT_MODEL_INFO_INIT \
  { sizeof(vsplat_model_info), 0, 0, 0, 0, 0, 0, 0, VSPLAT_HASH_ABSENT, 0 }

typedef struct vsplat_import_options {
  size_t size;
  const char* config_file;   /* a JSON object with fields of the configuration; NULL: none */
  const char* const* fields; /* [num_fields] "FIELD=VALUE" changes to it; may be NULL */
  size_t num_fields;
} vsplat_import_options;
#define VSPLAT_IMPORT_OPTIONS_INIT \
  { sizeof(vsplat_import_options), NULL, NULL, 0 }

/* How a model file holds its values; the library computes with float32. */
typedef enum vsplat_dtype {
  VSPLAT_DTYPE_F32 = 1,
  VSPLAT_DTYPE_F16 = 2 /* half the size */
} vsplat_dtype;

/* A new model with random weights. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_init(const vsplat_model_options* options,
                                                            vsplat_model* out_model);
/* Reads a model file (safetensors): checks its structure, every expected tensor and, where it states one, its hash.
   `path` NULL: the model that the library carries; VSPLAT_ERROR_FILE where it was built without one. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load(const char* path, vsplat_model* out_model);
/* The same of a model file's bytes, which are only read during the call. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_load_memory(const void* bytes, size_t size,
                                                                   vsplat_model* out_model);
/* A VS-Splat, LaRa or GenDen network of PyTorch's: a state dict in the published code's naming, with or without "net.",
   bare or in a checkpoint of Lightning's, as torch.save writes them since PyTorch 1.6. Nothing in the file is run: what
   is not a state dict's is refused by its name. What the tensors' shapes do not tell of the configuration is that of the
   named one which has all of them, else `options` says it, or the fields are named (VSPLAT_ERROR_USAGE).
   `negate_camera_centre` is true unless `options` says otherwise. `out_text`, which may be NULL, becomes a JSON
   object: "system" ("vsplat", "lara", "genden" or "vsplat+genden"), "config" (every field), "named" (the named
   configuration, or null) and "left_out", a list of what in the file is no part of the model. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_import(const char* path, const vsplat_import_options* options,
                                                              vsplat_model* out_model, char** out_text);
/* Writes a model file, whole or not at all; with its hash. An existing file is replaced. Values are float32. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save(vsplat_model model, const char* path);
/* The same with values of `dtype`. Of F16 each is rounded to the nearest, ties to even; VSPLAT_ERROR_INPUT where one is
   beyond its range (65504). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save_as(vsplat_model model, const char* path,
                                                               vsplat_dtype dtype);
/* The bytes of that file, `*out_size` of them; the caller's, to be freed by vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_save_memory(vsplat_model model, vsplat_dtype dtype,
                                                                   char** out_bytes, size_t* out_size);
/* The same model with another number of views that vsplat_input_prepare picks by default (vsplat_model_info.use_views),
   1 to max_views: for its makers, who have measured what is best. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_with_use_views(vsplat_model model, int32_t use_views,
                                                                      vsplat_model* out_model);
VSPLAT_API void vsplat_model_retain(vsplat_model model);
VSPLAT_API void vsplat_model_release(vsplat_model model);
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_get_info(vsplat_model model, vsplat_model_info* out_info);
/* What a model file's header says, without reading its values (hash: ABSENT or STATED), and the same as a JSON object:
   "config" (every field), "tensors", "parameters", "file_bytes", "dtypes", "sha256" and "provenance". Either out_
   pointer may be NULL. `path` NULL: as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_inspect(const char* path, vsplat_model_info* out_info,
                                                               char** out_text);
/* Reads all of a model file and keeps nothing: structure, shapes, and the hash where one is stated. `path` NULL:
   as for vsplat_model_load. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_verify(const char* path, vsplat_hash_state* out_state);

#ifdef __cplusplus
}
#endif

#endif
