"""Builds a program for this computer."""

from SCons.Script import Default, DefaultEnvironment

env = DefaultEnvironment()
# Sanitizers are switched on by one flag, which the link needs too.
sanitizers = [flag for flag in env.ParseFlags(env.subst("$BUILD_FLAGS")).get("CCFLAGS", []) if "-fsanitize" in flag]
env.Append(LINKFLAGS=sanitizers)
program = env.BuildProgram()
env.AddPlatformTarget("buildprog", program, program, "Build")
Default([program])
