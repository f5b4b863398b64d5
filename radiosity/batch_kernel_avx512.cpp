// SPDX-License-Identifier: GPL-3.0-or-later
#define INTERGLOW_LANES 8
#define INTERGLOW_KERNELS avx512_kernels
#define INTERGLOW_KERNEL_NAME "AVX-512"
#include "radiosity/batch_kernel_source.h"
