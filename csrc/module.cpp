// The Python module granpinn._C: what was built, and with which flags. It is loaded without torch.
#include <pybind11/pybind11.h>

#include "build_info.h"
#include "cpu/kernel_table.h"

PYBIND11_MODULE(_C, m) {
  m.doc() = "what granpinn was built with; granpinn.kernels.builds loads the operators";
  m.def("build_info", [] {
    namespace build = granpinn::build;
    pybind11::dict info;
    info["version"] = build::version;
    info["compiler"] = build::compiler;
    info["flags"] = build::flags;
    info["build_type"] = build::build_type;
    info["torch_versions"] = build::torch_versions;
    info["simd"] = build::simd;
    info["cuda_compiler"] = build::cuda_compiler;
    info["cuda_architectures"] = build::cuda_architectures;
    info["cuda_missing"] = build::cuda_missing;
    return info;
  });
  m.def(
      "laws",
      [] {
        pybind11::dict laws;
#define GRANPINN_ROW(row, Law) laws[Law::name] = Law::parameters;
        using namespace granpinn;
        GRANPINN_LAWS(GRANPINN_ROW)
#undef GRANPINN_ROW
        return laws;
      },
      "Number of parameters of every friction law, by name.");
  m.def(
      "physics_fields",
      [] {
        pybind11::list names;
        for (const char* name : granpinn::kPhysicsFields) names.append(name);
        return names;
      },
      "Names of the constants of a problem, in order.");
  m.def("cpu_capability", [] { return granpinn::kernels<float>().name; });
}
