"""PlatformIO pre-script: a build that counts its lines and ends at the first fault of memory or undefined behaviour."""

from SCons.Script import Import

Import("env")
env = globals()["env"]

FLAGS = ["-O1", "-g", "--coverage", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
env.Append(CCFLAGS=FLAGS, LINKFLAGS=FLAGS)
