# Sourced by run.sh and test.sh: installs Debian packages that are missing, and says so.

# install_missing PACKAGE...
# As root, or through sudo; otherwise prints the line to run and ends the script with exit code 1.
install_missing() {
    if ! command -v dpkg-query >/dev/null 2>&1 || ! command -v apt-get >/dev/null 2>&1; then
        echo "This is not Debian or Ubuntu: please make sure that the equivalents of these packages are installed: $*" >&2
        return 0
    fi
    missing=""
    for package in "$@"; do
        case "$(dpkg-query -W -f='${Status}' "$package" 2>/dev/null || true)" in
            "install ok installed") ;;
            *) missing="$missing $package" ;;
        esac
    done
    if [ -z "$missing" ]; then
        return 0
    fi
    missing="${missing# }"
    as_root=""
    if [ "$(id -u)" -ne 0 ]; then
        if command -v sudo >/dev/null 2>&1 && { [ -t 0 ] || sudo -n true 2>/dev/null; }; then
            as_root="sudo"
        else
            echo "Missing packages. Please run as root, then start again:" >&2
            echo "    apt-get update && apt-get install -y --no-install-recommends $missing" >&2
            exit 1
        fi
    fi
    echo "Installing: $missing"
    echo "    ${as_root:+$as_root }apt-get update && ${as_root:+$as_root }apt-get install -y --no-install-recommends $missing"
    # $missing is a list of words on purpose.
    # shellcheck disable=SC2086
    if ! { $as_root apt-get update -qq &&
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing; }; then
        echo "The installation failed. Please install by hand, then start again: $missing" >&2
        exit 1
    fi
}

# A C linker, which rustc calls as `cc`.
need_linker() {
    if command -v cc >/dev/null 2>&1; then
        return 0
    fi
    install_missing gcc libc6-dev
    if ! command -v cc >/dev/null 2>&1; then
        echo "There is no C linker (cc), which Rust needs. Please install one, then start again." >&2
        exit 1
    fi
}

# Cargo itself, also where the shell's profile does not name it yet.
need_cargo() {
    if ! command -v cargo >/dev/null 2>&1 && [ -x "${CARGO_HOME:-$HOME/.cargo}/bin/cargo" ]; then
        PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
        export PATH
    fi
    if ! command -v cargo >/dev/null 2>&1; then
        echo "cargo was not found. Please install Rust 1.95 or later with rustup." >&2
        exit 1
    fi
}
