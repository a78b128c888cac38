plugins {
    alias(libs.plugins.android.application)
    alias(libs.plugins.kotlin.android)
}

android {
    namespace = "org.phasefront.sample"
    compileSdk = 36

    defaultConfig {
        applicationId = "org.phasefront.sample"
        minSdk = 26
        targetSdk = 36
        versionCode = 1
        versionName = "1"
        ndk { abiFilters += listOf("arm64-v8a", "x86_64") }
    }

    compileOptions {
        sourceCompatibility = JavaVersion.VERSION_17
        targetCompatibility = JavaVersion.VERSION_17
    }

    buildTypes {
        release {
            // Uses R8, so that the sample tests the library's consumer rules.
            isMinifyEnabled = true
            proguardFiles(getDefaultProguardFile("proguard-android-optimize.txt"))
            signingConfig = signingConfigs.getByName("debug")
        }
    }

    sourceSets["main"].apply {
        // `core` uses no Android class except org.json, so pom.xml and android/test test it on a JVM.
        kotlin.srcDir("src/core/kotlin")
        // The project's sample scene.
        assets.srcDir("../../samples")
    }
}

kotlin { compilerOptions { jvmTarget.set(org.jetbrains.kotlin.gradle.dsl.JvmTarget.JVM_17) } }

dependencies {
    implementation(project(":phasefront"))
    implementation(libs.arcore)
}
