//! What gives a system a driver that aogauge can compute on.

use std::fs;

/// A family of systems that install drivers alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum System {
    /// Debian, Ubuntu and what follows them.
    Debian,
    /// Fedora, RHEL and what follows them.
    Fedora,
    /// Arch and what follows it.
    Arch,
    /// Another Linux, or another Unix.
    Other,
    /// Windows.
    Windows,
    /// macOS.
    Mac,
}

impl System {
    /// This machine's.
    pub fn here() -> Self {
        match std::env::consts::OS {
            "windows" => System::Windows,
            "macos" => System::Mac,
            _ => Self::of(&fs::read_to_string("/etc/os-release").unwrap_or_default()),
        }
    }

    /// By the text of `/etc/os-release`: what the system calls itself, or is like.
    fn of(os_release: &str) -> Self {
        let values = os_release.lines().filter_map(|l| l.strip_prefix("ID=").or(l.strip_prefix("ID_LIKE=")));
        let words = values.flat_map(|v| v.trim_matches(['"', '\'']).split_whitespace());
        let family = |word: &str| match word {
            "debian" | "ubuntu" => Some(System::Debian),
            "fedora" | "rhel" => Some(System::Fedora),
            "arch" => Some(System::Arch),
            _ => None,
        };
        words.into_iter().find_map(family).unwrap_or(System::Other)
    }

    /// How to get a software adapter, at least.
    pub fn software(self) -> &'static str {
        match self {
            System::Debian => "`apt-get install mesa-vulkan-drivers libvulkan1` gives a software one",
            System::Fedora => "`dnf install mesa-vulkan-drivers vulkan-loader` gives a software one",
            System::Arch => "`pacman -S vulkan-swrast vulkan-icd-loader` gives a software one",
            System::Other => "Mesa's Vulkan drivers (lavapipe) and the Vulkan loader give a software one",
            System::Windows => {
                "Windows 10 and later bring a software one (WARP) with DirectX 12: update Windows or the graphics driver"
            }
            System::Mac => "Metal is part of macOS; a virtual machine has it where its host passes it on",
        }
    }

    /// How to get the driver of a maker's hardware.
    pub fn hardware(self, maker: Maker) -> &'static str {
        match (self, maker) {
            (System::Debian, Maker::Nvidia) => {
                "`apt-get install nvidia-driver libvulkan1` (on Ubuntu `ubuntu-drivers install`)"
            }
            (System::Fedora, Maker::Nvidia) => "`dnf install akmod-nvidia vulkan-loader` from RPM Fusion",
            (System::Arch, Maker::Nvidia) => "`pacman -S nvidia nvidia-utils vulkan-icd-loader`",
            (System::Debian, _) => "`apt-get install mesa-vulkan-drivers libvulkan1`",
            (System::Fedora, _) => "`dnf install mesa-vulkan-drivers vulkan-loader`",
            (System::Arch, Maker::Amd) => "`pacman -S vulkan-radeon vulkan-icd-loader`",
            (System::Arch, Maker::Intel) => "`pacman -S vulkan-intel vulkan-icd-loader`",
            (System::Other, Maker::Nvidia) => "NVIDIA's driver and the Vulkan loader",
            (System::Other, _) => "Mesa's Vulkan drivers and the Vulkan loader",
            (System::Windows, _) => "the graphics driver from its maker's site",
            (System::Mac, _) => "macOS brings it",
        }
    }
}

/// Who made a GPU.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Maker {
    /// PCI vendor 0x1002.
    Amd,
    /// PCI vendor 0x8086.
    Intel,
    /// PCI vendor 0x10de.
    Nvidia,
}

impl Maker {
    /// The maker's name.
    pub fn name(self) -> &'static str {
        match self {
            Maker::Amd => "AMD",
            Maker::Intel => "Intel",
            Maker::Nvidia => "NVIDIA",
        }
    }

    /// Makers of the GPUs on this machine's PCI bus, where the system lists it
    /// (Linux), whether or not they have a driver.
    pub fn here() -> Vec<Self> {
        let devices = fs::read_dir("/sys/bus/pci/devices").into_iter().flatten().flatten();
        let read = |path: &std::path::Path, file: &str| fs::read_to_string(path.join(file)).unwrap_or_default();
        let mut makers: Vec<Self> =
            devices.filter_map(|d| Self::of(&read(&d.path(), "class"), &read(&d.path(), "vendor"))).collect();
        makers.dedup();
        makers
    }

    /// By PCI class (0x03: display) and vendor.
    fn of(class: &str, vendor: &str) -> Option<Self> {
        if !class.starts_with("0x03") {
            return None;
        }
        match vendor.trim() {
            "0x1002" => Some(Maker::Amd),
            "0x8086" => Some(Maker::Intel),
            "0x10de" => Some(Maker::Nvidia),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_known_by_what_they_are_like() {
        for (text, system) in [
            ("PRETTY_NAME=\"Debian GNU/Linux 12\"\nID=debian\n", System::Debian),
            ("ID=linuxmint\nID_LIKE=\"ubuntu debian\"\n", System::Debian),
            ("ID=\"rocky\"\nID_LIKE=\"rhel centos fedora\"\n", System::Fedora),
            ("ID=manjaro\nID_LIKE=arch\n", System::Arch),
            ("ID=alpine\n", System::Other),
            ("", System::Other),
        ] {
            assert_eq!(System::of(text), system, "{text}");
        }
    }

    #[test]
    fn makers_are_known_by_their_number() {
        assert_eq!(Maker::of("0x030000\n", "0x10de\n"), Some(Maker::Nvidia));
        assert_eq!(Maker::of("0x030200\n", "0x1002\n"), Some(Maker::Amd));
        assert_eq!(Maker::of("0x020000\n", "0x8086\n"), None, "a network card");
        assert_eq!(Maker::of("0x030000\n", "0x1af4\n"), None, "a virtual display");
    }
}
