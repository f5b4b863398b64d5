# SPDX-License-Identifier: GPL-3.0-or-later
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "status ${status} from: ${command}\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

set(prefix ${SCRATCH}/prefix)
file(REMOVE_RECURSE ${prefix} ${SCRATCH}/consumer-build)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${CONSUMER} -B ${SCRATCH}/consumer-build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release
  -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -DCMAKE_CXX_FLAGS=${FLAGS})
run(${CMAKE_COMMAND} --build ${SCRATCH}/consumer-build)
run(${SCRATCH}/consumer-build/consumer)
message(STATUS "form factor of facing squares: ${output}")

# The installed program takes its tables from the prefix, not from the source tree.
run(${prefix}/${BINDIR}/interglow run ${CONSUMER}/../scene/scene.toml --out ${SCRATCH}/out)
file(READ ${SCRATCH}/out/result.json result)
foreach(table fluorescent/paper_red.csv illuminants/d65.csv)
  string(FIND "${result}" "${prefix}/${DATADIR}/interglow/tables/${table}" place)
  if(place EQUAL -1)
    message(FATAL_ERROR "${table} was not read from ${prefix}:\n${result}")
  endif()
endforeach()
