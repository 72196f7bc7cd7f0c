//! QEMU from inside: the functions that the bus needs, found by name in the program that has loaded it.
//!
//! Debian builds QEMU with modules, so that its executable exports what they use, and with it everything here. Nothing of QEMU's is
//! linked or included; the declarations follow the headers of QEMU 7.2, 10.0 and 11.1, which agree in them. Where a name has changed both are
//! looked for, and the first that is missing is named.

use std::ffi::{c_char, c_int, c_void};
use std::sync::atomic::AtomicU8;

use libloading::os::unix::Library;

/// Something of QEMU's whose inside is its own business.
pub(crate) type Opaque = *mut c_void;
/// hwaddr.
pub(crate) type Address = u64;

/// Declares the functions, each by its name or names, newest first.
macro_rules! functions {
    ($($(#[$documentation:meta])* $field:ident: $type:ty = $($name:literal)|+;)*) => {
        /// What is found in the running QEMU.
        pub(crate) struct Functions { $($(#[$documentation])* pub(crate) $field: $type,)* }

        impl Functions {
            /// Looks everything up. The error names what is missing.
            pub(crate) fn find() -> Result<Self, &'static str> {
                let program = Library::this();
                Ok(Self { $(
                    $field: [$(concat!($name, "\0")),+]
                        .into_iter()
                        // SAFETY: each type is that of QEMU's function or variable of this name; the self-test calls them before the product
                        // runs.
                        .find_map(|name| unsafe { program.get::<$type>(name.as_bytes()) }.ok())
                        .map(|found| *found)
                        .ok_or(concat!($($name, " "),+))?,
                )* })
            }
        }
    };
}

functions! {
    /// The translation callback's arguments depend on the version, see [`crate::translated`].
    register_translation: unsafe extern "C" fn(u64, unsafe extern "C" fn(Opaque, Opaque), Opaque) = "qemu_plugin_register_vcpu_tb_trans_cb";
    instructions: unsafe extern "C" fn(Opaque) -> usize = "qemu_plugin_tb_n_insns";
    instruction: unsafe extern "C" fn(Opaque, usize) -> Opaque = "qemu_plugin_tb_get_insn";
    address: unsafe extern "C" fn(Opaque) -> u64 = "qemu_plugin_insn_vaddr";
    register_execution: unsafe extern "C" fn(Opaque, ExecutionCallback, c_int, Opaque) = "qemu_plugin_register_vcpu_insn_exec_cb";
    add_ready_notifier: unsafe extern "C" fn(*mut Notifier) = "qemu_add_machine_init_done_notifier";
    cpu: unsafe extern "C" fn(c_int) -> Opaque = "qemu_get_cpu";
    link: unsafe extern "C" fn(Opaque, *const c_char, Opaque) -> Opaque = "object_property_get_link";
    resolve: unsafe extern "C" fn(*const c_char, *const c_char, *mut bool) -> Opaque = "object_resolve_path_type";
    init_io: unsafe extern "C" fn(Opaque, Opaque, *const RegionOperations, Opaque, *const c_char, u64) = "memory_region_init_io";
    add_overlap: unsafe extern "C" fn(Opaque, Address, Opaque, c_int) = "memory_region_add_subregion_overlap";
    find_region: unsafe extern "C" fn(Opaque, Address, u64) -> Section = "memory_region_find";
    dispatch_read: unsafe extern "C" fn(Opaque, Address, *mut u64, c_int, u64) -> u32 = "memory_region_dispatch_read";
    dispatch_write: unsafe extern "C" fn(Opaque, Address, u64, c_int, u64) -> u32 = "memory_region_dispatch_write";
    space: unsafe extern "C" fn(Opaque, c_int) -> Opaque = "cpu_get_address_space";
    read: unsafe extern "C" fn(Opaque, Address, u64, Opaque, u64) -> u32 = "address_space_read_full";
    write: unsafe extern "C" fn(Opaque, Address, u64, *const c_void, u64) -> u32 = "address_space_write";
    write_rom: unsafe extern "C" fn(Opaque, Address, u64, *const c_void, u64) -> u32 = "address_space_write_rom";
    map: unsafe extern "C" fn(Opaque, Address, *mut Address, bool, u64) -> *mut u8 = "address_space_map";
    set_pending: unsafe extern "C" fn(Opaque, c_int, bool) = "armv7m_nvic_set_pending";
    lock: unsafe extern "C" fn(*const c_char, c_int) = "bql_lock_impl" | "qemu_mutex_lock_iothread_impl";
    unlock: unsafe extern "C" fn() = "bql_unlock" | "qemu_mutex_unlock_iothread";
    /// Leaves the translated code for the loop around it, with the processor as before the instruction at this place of the host's code.
    exit_restore: unsafe extern "C" fn(Opaque, usize) -> ! = "cpu_loop_exit_restore";
    /// While it is 1, a block is one instruction long.
    one_instruction: *const AtomicU8 = "one_insn_per_tb" | "singlestep";
    dump_state: unsafe extern "C" fn(Opaque, *mut libc::FILE, c_int) = "cpu_dump_state";
}

/// Called before an instruction is executed, with the processor's number and what was given at its translation.
pub(crate) type ExecutionCallback = unsafe extern "C" fn(u32, Opaque);

/// The callback may read and write the registers, so that all of them lie in memory.
pub(crate) const CALLBACK_USES_REGISTERS: c_int = 2;

/// Notifier.
#[repr(C)]
pub(crate) struct Notifier {
    pub(crate) notify: unsafe extern "C" fn(*mut Notifier, Opaque),
    pub(crate) node: [Opaque; 2],
}

/// MemoryRegionOps.
#[repr(C)]
pub(crate) struct RegionOperations {
    pub(crate) read: unsafe extern "C" fn(Opaque, Address, u32) -> u64,
    pub(crate) write: unsafe extern "C" fn(Opaque, Address, u64, u32),
    pub(crate) with_attributes: [usize; 2],
    pub(crate) endianness: c_int,
    pub(crate) valid: Widths,
    pub(crate) implemented: Widths,
}

/// The widths in bytes that a region takes; of an access that is wider QEMU makes several.
#[repr(C)]
pub(crate) struct Widths {
    pub(crate) least: u32,
    pub(crate) most: u32,
    pub(crate) unaligned: bool,
    pub(crate) accepts: usize,
}

impl RegionOperations {
    /// Bytes to words, little-endian.
    pub(crate) const fn new(
        read: unsafe extern "C" fn(Opaque, Address, u32) -> u64,
        write: unsafe extern "C" fn(Opaque, Address, u64, u32),
    ) -> Self {
        const LITTLE_ENDIAN: c_int = 2;
        const fn widths() -> Widths {
            Widths { least: 1, most: 4, unaligned: true, accepts: 0 }
        }
        Self { read, write, with_attributes: [0; 2], endianness: LITTLE_ENDIAN, valid: widths(), implemented: widths() }
    }
}

/// MemoryRegionSection: what is used of it, and room for what later versions append.
#[repr(C, align(16))]
#[derive(Clone, Copy)]
pub(crate) struct Section {
    size: [u64; 2],
    pub(crate) region: Opaque,
    view: Opaque,
    pub(crate) offset: Address,
    more: [u64; 13],
}

/// VersionInfo and VersionTriple, as `query-version` of QEMU's monitor answers.
#[repr(C)]
struct VersionInfo {
    triple: *const [i64; 3],
    package: Opaque,
}

/// The major version of the running QEMU; `None` where it does not tell.
pub(crate) fn major_version() -> Option<i64> {
    type Query = unsafe extern "C" fn(*mut Opaque) -> *const VersionInfo;
    let program = Library::this();
    // SAFETY: QEMU's function of this name has this type since 2.7. It only allocates, so that it may be called before QEMU's main function;
    // a null pointer for the error means that none is wanted, and what it answers stays allocated.
    unsafe {
        let query = program.get::<Query>(b"qmp_query_version\0").ok()?;
        let info = query(std::ptr::null_mut()).as_ref()?;
        Some(info.triple.as_ref()?[0])
    }
}
