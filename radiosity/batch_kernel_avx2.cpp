// SPDX-License-Identifier: GPL-3.0-or-later
#define INTERGLOW_LANES 4
#define INTERGLOW_KERNELS avx2_kernels
#define INTERGLOW_KERNEL_NAME "AVX2"
#include "radiosity/batch_kernel_source.h"
