"""Builds an AVR program without a framework: compile, link, make the hex, show the size, upload."""

from SCons.Script import AlwaysBuild, Builder, Default, DefaultEnvironment

env = DefaultEnvironment()
mcu = env.BoardConfig().get("build.mcu")

env.Replace(
    CC="avr-gcc",
    CXX="avr-g++",
    AS="avr-gcc",
    AR="avr-ar",
    RANLIB="avr-ranlib",
    SIZETOOL="avr-size",
    PROGSUFFIX=".elf",
    SIZEPRINTCMD="$SIZETOOL --mcu=$BOARD_MCU -C $SOURCES",
    SIZEPROGREGEXP=r"^(?:\.text|\.data|\.bootloader)\s+(\d+).*",
    SIZEDATAREGEXP=r"^(?:\.data|\.bss|\.noinit)\s+(\d+).*",
    SIZECHECKCMD="$SIZETOOL -A -d $SOURCES",
    UPLOADER="avrdude",
    UPLOADCMD="$UPLOADER -p $BOARD_MCU -c arduino -b $UPLOAD_SPEED -P $UPLOAD_PORT -D -U flash:w:$SOURCES:i",
)
env.Append(
    CCFLAGS=[f"-mmcu={mcu}"],
    LINKFLAGS=[f"-mmcu={mcu}"],
    CPPDEFINES=[("F_CPU", "$BOARD_F_CPU")],
    BUILDERS={
        "ElfToHex": Builder(
            action=env.VerboseAction("avr-objcopy -O ihex -R .eeprom $SOURCES $TARGET", "Building $TARGET"),
            suffix=".hex",
        )
    },
)

elf = env.BuildProgram()
firmware = env.ElfToHex("$BUILD_DIR/${PROGNAME}", elf)
env.AddPlatformTarget("buildprog", firmware, firmware, "Build")
size = env.AddPlatformTarget("size", elf, env.VerboseAction("$SIZEPRINTCMD", "Size of $SOURCE"), "Size")
upload = env.AddPlatformTarget(
    "upload",
    firmware,
    [
        env.VerboseAction(env.AutodetectUploadPort, "Looking for the upload port"),
        env.VerboseAction("$UPLOADCMD", "Uploading $SOURCE"),
    ],
    "Upload",
)
AlwaysBuild(size, upload)
Default([firmware, size])
